#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/capture/chroma_key.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A mask is 8-bit, one channel, 255 where the person is and 0 elsewhere.

/// Pixels >= threshold become 255.
cv::Mat threshold_mask(const cv::Mat& grey, int threshold);
/// Only the largest 8-connected part.
cv::Mat largest_component(const cv::Mat& mask);
/// Cuts the person out by colour. @param background the empty studio, BGR; empty unless key.against_background
cv::Mat chroma_key_mask(const cv::Mat& image, const ChromaKey& key, const cv::Mat& background);

/// A square window of an image, resized to some number of pixels: u' = (u - u0) * pixels / side, in coordinates where
/// pixel centres lie at +0.5. The window may reach beyond the image (letterbox).
struct CropBox {
  int u0 = 0, v0 = 0, side = 0;

  bool empty() const { return side <= 0; }
  double image_pixels_per_pixel(int pixels) const { return static_cast<double>(side) / pixels; }
  bool operator==(const CropBox& other) const { return u0 == other.u0 && v0 == other.v0 && side == other.side; }
};

/// The bounding box of a mask with `margin` times its longer side added on every side, made square, and shifted into
/// the image where it fits. Empty when the mask is.
CropBox crop_of_mask(const cv::Mat& mask, double margin);
/// The window of `mask`, resized to pixels x pixels, still 0 or 255. Beyond the image its border pixels are repeated:
/// a body cut off by the image's edge goes on instead of ending in a contour that nobody has.
cv::Mat crop_mask(const cv::Mat& mask, const CropBox& box, int pixels);
/// The window of a colour image; black beyond it.
cv::Mat crop_image(const cv::Mat& image, const CropBox& box, int pixels);
/// The camera of the window.
Camera crop_camera(const Camera& camera, const CropBox& box, int pixels);

/// Share of the foreground, and whether it touches the image's border.
struct MaskFacts {
  long area = 0;
  bool touches_border = false;
};
MaskFacts inspect_mask(const cv::Mat& mask);

/// Signed Euclidean distance in pixels, float: + outside, - inside, measured to the nearest pixel centre of the other
/// set minus 0.5, so that zero lies on the edge between pixels. The mask must hold both kinds of pixels.
cv::Mat signed_distance(const cv::Mat& mask);

/// A pixel of the mask's outline, by column and row.
struct ContourPixel {
  std::uint16_t x, y;
};
/// Mask pixels with a neighbour (of four) outside the mask, in row order; only those with at least four such pixels,
/// itself included, in the 5x5 window around it, which drops specks.
std::vector<ContourPixel> contour_pixels(const cv::Mat& mask);

/// Takes the lens distortion out of a camera's images.
class Undistorter {
 public:
  explicit Undistorter(const Camera& camera);
  /// The same image seen by `pinhole()`; the input itself when the camera has no distortion.
  cv::Mat apply(const cv::Mat& image) const;
  /// Where `pinhole()` sees what the camera sees at a pixel. Finite for finite pixels.
  Eigen::Vector2d apply(const Eigen::Vector2d& pixel) const;
  /// The camera without distortion: same K, size and pose.
  const Camera& pinhole() const { return pinhole_; }

 private:
  cv::Matx33d opencv_intrinsics() const;

  Camera pinhole_;
  std::vector<double> coefficients_;  ///< empty without distortion
  cv::Mat map1_, map2_;
};

}  // namespace doppel
