#pragma once

#include <filesystem>
#include <string>

namespace doppel {

/// What a run has written so far, read anew at each call, so that it follows a run that is training.

/// JSON `{"stages": [...]}` of the stages that have begun: `name`, `steps`, `seconds`, `curves` (name of the curve ->
/// [[step, value], ...], at most 500 points: `loss`, and the weighted terms when there are several) and `images`
/// (`caption`, `written`: changes when the image is written again)
std::string training_state(const std::filesystem::path& run);

/// An image of `training_state` as JPEG. @param stage, image positions in its lists
/// @throws UsageError when there is no such image
std::string training_image(const std::filesystem::path& run, int stage, int image);

}  // namespace doppel
