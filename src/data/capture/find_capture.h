#pragma once

#include <filesystem>
#include <optional>

#include "doppel/data/capture/capture_guess.h"

namespace doppel {

/// The capture at a path: that of a `.yaml` file or of the folder's capture.yaml; without one, that of the first public
/// layout that the folder has (docs/capture.md).
/// @return nothing when the path is none of these
/// @throws Error as `read_capture`; Error when the folder has the videos of a public layout, but lacks other files of
/// it, or holds several of one kind
std::optional<CaptureGuess> recognise_capture(const std::filesystem::path& path);

/// As `recognise_capture`, for what has to be a capture. Logs what was recognised.
/// @throws Error that says what a capture's folder must contain when nothing is recognised
Capture find_capture(const std::filesystem::path& path);

/// The capture that a folder may become, whatever lies in it: the first layout that it has, else a guess by the names
/// of videos, images and cameras. Ignores its capture.yaml.
/// @throws Error when `folder` is not a folder, has braces in its path, or holds more than 500,000 files
CaptureGuess guess_folder(const std::filesystem::path& folder);

}  // namespace doppel
