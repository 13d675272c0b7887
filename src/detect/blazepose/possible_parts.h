#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "doppel/detect/blazepose/static_background.h"

namespace doppel {

/// A pixel of a mask that may show the person: other cameras decide (`settle_masks`). It is background for a reader
/// with a threshold of 128.
inline constexpr std::uint8_t kPossiblePerson = 64;

/// Marks what the network may have missed, for example a far arm beside the trunk: parts beside the mask whose colours
/// differ from the learnt background by 30 levels of 255 or more. Brightness counts 0.4 of other differences, because
/// shadows change it. A part touches the mask and lies within 0.4 of the person's longer side. It is wider than 2 cells
/// (`mask_cell`), so that the blur along the outline does not count.
/// @param image 8-bit BGR
/// @param mask of the person, 0 or 255, size of the image; the pixels that are marked become kPossiblePerson
/// @param background of this camera; nothing is marked where it is not known, or for an image of another size
/// @throws UsageError for another type or size of the mask
void mark_possible_parts(const cv::Mat& image, cv::Mat& mask, const StaticBackground& background);

}  // namespace doppel
