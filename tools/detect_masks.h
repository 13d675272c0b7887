#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "detect_sources.h"
#include "doppel/detect/blazepose/mask_agreement.h"
#include "doppel/detect/blazepose/static_background.h"

namespace doppel::tools {

/// The file of a mask in a folder of masks.
std::filesystem::path mask_file(const std::filesystem::path& folder, long frame);

/// Learns what a camera sees behind people (detect/blazepose/static_background.h) from frames that are spread over its
/// video. Needs 256 MiB.
/// @param people the mask of everybody in an image, 8-bit, of its size
StaticBackground learn_background_of(const DetectSource& source,
                                     const std::function<cv::Mat(const cv::Mat& image)>& people);

/// Whether `compare_masks` compares the masks of a source: its sequence has three calibrated cameras or more.
bool is_compared(const DetectSource& source, std::span<const DetectSource> sources);
/// Settles masks by the other cameras of the same sequence (detect/blazepose/mask_agreement.h), moment by moment.
/// Sequences with fewer than three cameras stay as they are.
/// @param sources of a capture @param folders [sources] with the masks
/// @param go_on asked before each moment; false: stop
SettledPixels compare_masks(std::span<const DetectSource> sources, std::span<const std::filesystem::path> folders,
                            const std::function<bool()>& go_on);
/// How often `compare_masks` asks whether to go on.
long num_compared_moments(std::span<const DetectSource> sources);

}  // namespace doppel::tools
