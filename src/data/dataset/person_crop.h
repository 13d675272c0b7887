#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/dataset/sampling.h"
#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The square window of a camera's image that is the input of a network. Unlike a CropBox, the window may start between
/// pixels and extend beyond the image.
struct PersonWindow {
  double u0 = 0.0, v0 = 0.0, side = 0.0;

  bool empty() const { return !(side > 0.0); }
  /// The camera of the window, resized to pixels x pixels.
  PinholeCamera camera(const PinholeCamera& camera, int pixels) const;
};

/// The bounding box of the keypoints with a fifth of its longer side added on every side, made square.
/// Points with a confidence below kSeenConfidence do not count. Points outside of the mask's box by more than a tenth
/// of its longer side do not count either. If fewer than four points are left, the mask's box is used instead.
/// @param mask_box in pixels of the image; empty: no mask
/// @return empty when there are neither enough points nor a mask
PersonWindow person_window(const std::vector<Keypoint>& keypoints, const cv::Rect2d& mask_box);

/// ImageNet's mean and standard deviation. The input of a network is (colour - mean) / deviation, colours 0..1.
inline constexpr float kInputMean[3]{0.485f, 0.456f, 0.406f}, kInputDeviation[3]{0.229f, 0.224f, 0.225f};
/// Margin of the window around the keypoints, as a share of the longer side of their box.
inline constexpr double kPersonMargin = 0.2;

/// A change of colours: brightness, contrast and saturation are factors, hue is an angle about the grey axis, radians.
struct Photometry {
  double brightness = 1.0, contrast = 1.0, saturation = 1.0, hue = 0.0;
};
/// Draws a change of colours: brightness, contrast and saturation within 20 %, hue within 5 % of the full circle.
Photometry draw_photometry(SplitMix& random);
/// Draws a window that is moved and resized by up to 5 % of the given window's side.
PersonWindow draw_window(const PersonWindow& window, SplitMix& random);

/// An image, or a part of one, with the mask of the person.
struct PersonImage {
  cv::Mat rgb;                  ///< 8-bit, three channels
  cv::Mat foreground;           ///< 8-bit, not 0 = person
  double u0 = 0.0, v0 = 0.0;    ///< its upper left corner in the camera's image
  double scale = 1.0;           ///< its pixels per pixel of the camera's image
  cv::Rect2d mask_box() const;  ///< box of the foreground, in pixels of the camera's image; may be empty
};

/// Writes the input of a network: the resized window, black outside the mask, with the change of colours (black stays
/// black), and standardised by ImageNet's mean and deviation.
/// @param to [3, pixels, pixels] red, green, blue
void write_person(const PersonImage& image, const PersonWindow& window, const Photometry& photometry, int pixels,
                  float* to);

/// The input of a network for one whole image, without random changes, as in the evaluation during training.
struct PersonInput {
  bool valid = false;    ///< false: nobody is seen; the image is black and `camera` is that of the whole image
  torch::Tensor image;   ///< float32 [3,S,S]
  PinholeCamera camera;  ///< of the window
};
/// @param bgr image without lens distortion; the keypoints are in its pixels @param mask empty: nobody is seen
/// @throws UsageError when image and mask differ in size
PersonInput person_input(const cv::Mat& bgr, const cv::Mat& mask, const std::vector<Keypoint>& keypoints,
                         const PinholeCamera& camera, int pixels);

}  // namespace doppel
