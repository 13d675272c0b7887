#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/capture/capture.h"

namespace doppel {

/// A capture folder of a public dataset, recognised without a capture.yaml, and the sentences that say what was found.
struct RecognisedCapture {
  Capture capture;
  std::string layout;              ///< "DynaCap" or "ASH/TriHuman"
  std::vector<std::string> notes;  ///< what was taken for what, in plain sentences
};

/// Looks for the layouts of the public releases (formats.md 8 of the project's notes; docs/capture.md):
/// - DynaCap: `training|testing/img/c_<cam>.avi`, masks in `fg/c_<cam>.avi`;
/// - ASH / TriHuman / UMA: `training|testing/{videos|images|.}/streamNNN.<ext>`, masks in `foregroundSegmentation/`.
/// The calibration, the character and the poses are looked for in the folder and up to two levels below. Cuts are
/// taken from `<split>/frames.csv` (columns frame,segment) where there is one.
/// @return nothing when no sequence is found
/// @throws Error when a sequence is found but calibration, character or masks are missing, or one of them or the poses
/// ambiguous
std::optional<RecognisedCapture> recognise_capture(const std::filesystem::path& folder);

/// `read_capture` when the folder has a capture.yaml (or the path is a file), `recognise_capture` otherwise.
/// @throws Error that says what a capture folder must hold when neither works
Capture find_capture(const std::filesystem::path& file_or_folder);

}  // namespace doppel
