#pragma once

#include <functional>
#include <optional>
#include <string>

#include "doppel/data/capture/capture_guess.h"
#include "doppel/data/capture/layouts/folder_listing.h"

namespace doppel {

/// A way in which the files of a capture may lie in a folder.
struct FolderLayout {
  std::string name;
  bool sure = true;  ///< whether its sign leaves no doubt; otherwise a person has to confirm the guess
  /// The files that show that a folder has this layout; nothing when it does not.
  std::function<std::optional<std::string>(const FolderListing&)> sign;
  /// The capture. @pre the folder has the sign
  /// @throws Error when files are missing or ambiguous, and the layout leaves no room for a guess
  std::function<CaptureGuess(const FolderListing&)> guess;
};

}  // namespace doppel
