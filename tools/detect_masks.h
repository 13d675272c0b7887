#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "detect_sources.h"

namespace doppel::tools {

/// The file of a mask in a folder of masks.
std::filesystem::path mask_file(const std::filesystem::path& folder, long frame);

/// Replaces the network's masks of a camera by masks at full resolution (detect/blazepose/mask_sharpening.h). The
/// background is learnt from the camera's own images. Needs 256 MiB for that, and two images otherwise.
/// @param folder of the network's masks, one for each frame of the source
/// @param advance called after each frame; returns false to stop
/// @return false when it was stopped
/// @throws FileError for a mask that is missing
bool sharpen_masks(const DetectSource& source, const std::filesystem::path& folder,
                   const std::function<bool()>& advance);

/// Removes pixels of masks that the other cameras of the same sequence contradict (detect/blazepose/mask_agreement.h),
/// moment by moment. Sequences with fewer than three cameras stay as they are.
/// @param sources of a capture @param folders [sources] with the masks
/// @param go_on asked before each moment; false: stop
/// @return the number of removed pixels
long compare_masks(std::span<const DetectSource> sources, std::span<const std::filesystem::path> folders,
                   const std::function<bool()>& go_on);

}  // namespace doppel::tools
