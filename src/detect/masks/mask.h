#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/detect/masks/chroma_key.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A mask is 8-bit, one channel, 255 where the person is and 0 elsewhere.

/// Pixels >= threshold become 255.
cv::Mat threshold_mask(const cv::Mat& grey, int threshold);
/// The mask of the person by colour. @param background image of the empty studio, BGR; empty unless
/// key.against_background
cv::Mat chroma_key_mask(const cv::Mat& image, const ChromaKey& key, const cv::Mat& background);

/// A square window of an image, resized to a number of pixels: u' = (u - u0) * pixels / side, with pixel centres at
/// +0.5. The window may extend beyond the image (letterbox).
struct CropBox {
  int u0 = 0, v0 = 0, side = 0;

  bool empty() const { return side <= 0; }
  double image_pixels_per_pixel(int pixels) const { return static_cast<double>(side) / pixels; }
  bool operator==(const CropBox& other) const { return u0 == other.u0 && v0 == other.v0 && side == other.side; }
};

/// The bounding box of a mask with `margin` times its longer side added on every side, made square, and shifted into
/// the image where it fits. Empty when the mask is empty.
CropBox crop_of_mask(const cv::Mat& mask, double margin);
/// The window of `mask`, resized to pixels x pixels, still 0 or 255. Beyond the image its border pixels are repeated,
/// so that a body cut off by the image border gets no false outline there.
cv::Mat crop_mask(const cv::Mat& mask, const CropBox& box, int pixels);
/// The window of a colour image; black beyond the image.
cv::Mat crop_image(const cv::Mat& image, const CropBox& box, int pixels);
/// The camera of the window.
PinholeCamera crop_camera(const PinholeCamera& camera, const CropBox& box, int pixels);

/// Area of the foreground in pixels, and whether it touches the image border.
struct MaskFacts {
  long area = 0;
  bool touches_border = false;
};
MaskFacts inspect_mask(const cv::Mat& mask);

/// The distance field of a mask: signed Euclidean distance in pixels, float, + outside, - inside. The distance is
/// measured to the nearest pixel centre of the other set minus 0.5, so that zero lies on the edge between pixels. The
/// mask must contain both kinds of pixels.
cv::Mat signed_distance(const cv::Mat& mask);

/// A pixel of the mask's outline, by column and row.
struct ContourPixel {
  std::uint16_t x, y;
};
/// The contour pixels of a mask, in row order: mask pixels with a neighbour (of four) outside the mask. Only those are
/// kept that have at least four such pixels, themselves included, in the 5x5 window around them; this drops specks.
std::vector<ContourPixel> contour_pixels(const cv::Mat& mask);

}  // namespace doppel
