#pragma once

#include <opencv2/core.hpp>

namespace doppel {

/// Cycles per pixel above which a frequency counts as detail: there the high-pass filter passes half of the energy.
inline constexpr double kDetailFrequency = 0.125;

/// The energy of an image's details inside a region: the mean square of the grey levels minus their Gaussian mean, in
/// which only pixels of the region count, so that the region's outline adds nothing.
/// @param rgb 8-bit RGB @param region 8-bit of the same size, not 0 inside @return 0 for an empty region
double detail_energy(const cv::Mat& rgb, const cv::Mat& region);

}  // namespace doppel
