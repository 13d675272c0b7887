#pragma once

#include <filesystem>
#include <optional>

#include "doppel/data/capture/recognised_capture.h"

namespace doppel {

/// Recognises the folder layouts of the public releases (docs/capture.md):
/// - DynaCap: `training|testing/img/c_<cam>.avi`, masks in `fg/c_<cam>.avi`;
/// - ASH / TriHuman / UMA: `training|testing/{videos|images|.}/streamNNN.<ext>`, masks in `foregroundSegmentation/`.
///   The calibration, the character and the poses are searched for in the folder and up to two levels below it. Cuts
///   are read from `<split>/frames.csv` (columns frame,segment) if it exists;
/// - the datasets of dataset_layouts.h, which have neither character nor, some of them, masks.
/// @return nothing when no sequence is found
/// @throws Error when a sequence of the first two is found but calibration, character or masks are missing, or when one
/// of them or the poses are ambiguous
std::optional<RecognisedCapture> recognise_capture(const std::filesystem::path& folder);

/// `read_capture` when the folder has a capture.yaml (or the path is a file), `recognise_capture` otherwise.
/// @throws Error that says what a capture folder must contain when neither succeeds
Capture find_capture(const std::filesystem::path& file_or_folder);

}  // namespace doppel
