#pragma once

#include <torch/torch.h>

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/capture/keypoints.h"
#include "doppel/data/sampling.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The square window of a camera's image that a network sees; unlike a CropBox it may begin between pixels and reach
/// beyond the image.
struct PersonWindow {
  double u0 = 0.0, v0 = 0.0, side = 0.0;

  bool empty() const { return !(side > 0.0); }
  /// The camera of the window resized to pixels x pixels.
  Camera camera(const Camera& camera, int pixels) const;
};

/// The box of the keypoints with a fifth of its longer side added on every side, made square.
/// Points less sure than kSeenConfidence do not count, nor do those outside of the mask's box by more than a tenth of
/// its longer side; with fewer than four points left the mask's box is taken instead.
/// @param mask_box in pixels of the image; empty: no mask
/// @return empty when there are neither enough points nor a mask
PersonWindow person_window(const std::vector<Keypoint>& keypoints, const cv::Rect2d& mask_box);

/// ImageNet's mean and deviation, which a network's input has taken out: (colour - mean) / deviation, colours 0..1.
inline constexpr float kInputMean[3]{0.485f, 0.456f, 0.406f}, kInputDeviation[3]{0.229f, 0.224f, 0.225f};
/// What the window has around the keypoints, as a share of their longer side.
inline constexpr double kPersonMargin = 0.2;

/// A change of colours: brightness, contrast and saturation are factors, hue is an angle about the grey axis, radians.
struct Photometry {
  double brightness = 1.0, contrast = 1.0, saturation = 1.0, hue = 0.0;
};
/// Brightness, contrast and saturation within 20 %, hue within 5 % of the full circle.
Photometry draw_photometry(SplitMix& random);
/// Moved and resized by up to 5 % of its side.
PersonWindow draw_window(const PersonWindow& window, SplitMix& random);

/// An image, or a part of one, with the person's pixels marked.
struct PersonImage {
  cv::Mat rgb;                  ///< 8-bit, three channels
  cv::Mat foreground;           ///< 8-bit, not 0 = person
  double u0 = 0.0, v0 = 0.0;    ///< where it begins in the camera's image
  double scale = 1.0;           ///< its pixels per pixel of the camera's image
  cv::Rect2d mask_box() const;  ///< of the foreground, in pixels of the camera's image; empty without one
};

/// Writes what a network sees: the window resized, black where no person is, then the change of colours (black stays
/// black), then ImageNet's mean and deviation.
/// @param to [3, pixels, pixels] red, green, blue
void write_person(const PersonImage& image, const PersonWindow& window, const Photometry& photometry, int pixels,
                  float* to);

/// The same for one whole image, without anything random: what training's evaluation sees.
struct PersonInput {
  bool valid = false;     ///< false: nobody is seen; everything is black and `camera` the whole one
  torch::Tensor image;  ///< float32 [3,S,S]
  Camera camera;          ///< of the window
};
/// @param bgr without lens distortion, as are the keypoints. @param mask empty mask: nobody
/// @throws UsageError when image and mask differ in size
PersonInput person_input(const cv::Mat& bgr, const cv::Mat& mask, const std::vector<Keypoint>& keypoints,
                         const Camera& camera, int pixels);

}  // namespace doppel
