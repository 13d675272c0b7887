#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace doppel {

/// What a static camera sees behind a person.
struct StaticBackground {
  cv::Mat colour;  ///< 8-bit BGR
  cv::Mat known;   ///< 8-bit, one channel: 255 where `colour` is known, 0 elsewhere

  /// The share of the image whose colour is known; 0 for an empty background.
  double known_share() const;
};

/// Learns the background from images with a person: per pixel, the median of the images in which the person is not
/// there. A colour is known where five images or more show the background and agree. Nothing is known if most of the
/// pixels disagree, as when the camera moves. Fewer than five images therefore give an unknown background.
/// @param images 8-bit BGR; those of another size than the first are left out
/// @param masks [images] the person, 8-bit, coarse: values of 51 or more, and what is near to them, are left out. An
/// empty scene has a black mask
/// @throws UsageError when the numbers differ, for another type, or for a mask that does not fit its image
StaticBackground learn_background(const std::vector<cv::Mat>& images, const std::vector<cv::Mat>& masks);

/// The frames to learn from: evenly spread, at most 41, and so many that their images and masks take at most 256 MiB,
/// but seven at least. @param image size of the images
std::vector<long> background_frames(const std::vector<long>& frames, cv::Size image);

/// The size of the smallest detail in a network's mask, pixels: a two-hundredth of the longer side of the person's
/// bounding box, 1 or more.
double mask_cell(const cv::Mat& person);

}  // namespace doppel
