#pragma once

#include <opencv2/core.hpp>

#include "doppel/detect/blazepose/static_background.h"

namespace doppel {

/// The mask of a person at the resolution of the image, from the coarse mask of a network.
///
/// Near the coarse outline, and where the network is unsure (0.1 <= p < 0.9), a pixel's colour I is compared with the
/// colour F of the person beside it and the colour B of the background: its coverage is a = <I - B, F - B> / |F - B|^2.
/// The pixel belongs to the person if
///     a >= 1/2 - s^2 log(p / (1 - p)) / |F - B|^2,
/// with the network's probability p and the deviation s of the colours. Where person and background look alike, the
/// network therefore decides. F is a Gaussian mean over the inside of the outline. B is the learnt colour times the
/// mean ratio of seen and learnt brightness outside of the outline, which follows shadows and exposure; where nothing
/// is learnt, B is the mean colour outside. Brightness counts less than other differences of colour, because shadows
/// change it. This is repeated with smaller and smaller windows; the last one grows with the person, as the blur does.
///
/// @param image 8-bit BGR
/// @param probability of the person times 255, 8-bit, size of the image. The outline may be off by 1 % of the person's
/// longer side, as with BlazePose, and by more where the network is unsure
/// @param background of this camera; not used for an image of another size
/// @return 255 on the person, 0 elsewhere; specks and small holes are removed. Black if no probability reaches 128
/// @throws UsageError for another type or size of the probability
cv::Mat sharpen_mask(const cv::Mat& image, const cv::Mat& probability, const StaticBackground& background = {});

}  // namespace doppel
