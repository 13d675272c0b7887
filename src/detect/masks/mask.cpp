#include "doppel/detect/masks/mask.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr int kContourWindow = 2;  // 5x5, method of the silhouette loss
constexpr int kMinContourInWindow = 4;

/// The key as an image of one pixel or of the whole studio, in 32-bit YCrCb.
cv::Mat key_image(const ChromaKey& key, const cv::Mat& image, const cv::Mat& background) {
  if (key.against_background) {
    if (background.size() != image.size())
      fail("the image of the empty studio is {}x{}, the video {}x{}; they must be equal", background.cols,
           background.rows, image.cols, image.rows);
    return background;
  }
  return cv::Mat(image.size(), CV_8UC3, cv::Scalar(key.colour[2], key.colour[1], key.colour[0]));
}

/// Background where the hue is near the key's and the saturation is high enough.
cv::Mat hsv_background(const cv::Mat& image, const cv::Mat& key, const ChromaKey& options) {
  cv::Mat pixels, keys;
  cv::cvtColor(image, pixels, cv::COLOR_BGR2HSV);
  cv::cvtColor(key, keys, cv::COLOR_BGR2HSV);
  cv::Mat result(image.size(), CV_8U);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const cv::Vec3b& pixel = pixels.at<cv::Vec3b>(row, column);
      const int difference = std::abs(pixel[0] - keys.at<cv::Vec3b>(row, column)[0]);
      const double degrees = 2.0 * std::min(difference, 180 - difference);  // OpenCV's hue counts in 2 degrees
      const bool background = degrees <= options.tolerance && pixel[1] >= 255.0 * options.min_saturation;
      result.at<std::uint8_t>(row, column) = background ? 255 : 0;
    }
  return result;
}

/// Background where the chroma, scaled to the key's brightness, is near the key's. With this scaling, shadows on the
/// studio floor count as background. The scale is bounded so that it does not amplify the noise of dark cloth to a
/// colour.
cv::Mat ycrcb_background(const cv::Mat& image, const cv::Mat& key, const ChromaKey& options) {
  constexpr double kMaxGain = 3.0;
  cv::Mat pixels, keys;
  cv::cvtColor(image, pixels, cv::COLOR_BGR2YCrCb);
  cv::cvtColor(key, keys, cv::COLOR_BGR2YCrCb);
  cv::Mat result(image.size(), CV_8U);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const cv::Vec3b &pixel = pixels.at<cv::Vec3b>(row, column), &wanted = keys.at<cv::Vec3b>(row, column);
      const double gain = std::min(wanted[0] / std::max(1.0, static_cast<double>(pixel[0])), kMaxGain);
      const double red = (pixel[1] - 128.0) * gain - (wanted[1] - 128.0);
      const double blue = (pixel[2] - 128.0) * gain - (wanted[2] - 128.0);
      result.at<std::uint8_t>(row, column) = std::hypot(red, blue) <= options.tolerance ? 255 : 0;
    }
  return result;
}

/// Moves an interval of length `side` into [0, size] where it fits; centres it where it does not.
int fit_start(int start, int side, int size) {
  return side <= size ? std::clamp(start, 0, size - side) : (size - side) / 2;
}

/// The window at full resolution; `border` defines the pixels beyond the image.
cv::Mat cut_window(const cv::Mat& image, const CropBox& box, int border) {
  const cv::Rect window(box.u0, box.v0, box.side, box.side);
  const cv::Rect inside = window & cv::Rect(0, 0, image.cols, image.rows);
  if (inside.area() == 0) fail("internal: a crop window lies outside of its image");
  cv::Mat result;
  cv::copyMakeBorder(image(inside), result, inside.y - window.y, window.br().y - inside.br().y, inside.x - window.x,
                     window.br().x - inside.br().x, border | cv::BORDER_ISOLATED);
  return result;
}

cv::Mat resize_square(const cv::Mat& image, int pixels) {
  cv::Mat result;
  const int method = image.cols > pixels ? cv::INTER_AREA : cv::INTER_LINEAR;
  cv::resize(image, result, {pixels, pixels}, 0.0, 0.0, method);
  return result;
}

}  // namespace

cv::Mat threshold_mask(const cv::Mat& grey, int threshold) { return grey >= threshold; }

cv::Mat chroma_key_mask(const cv::Mat& image, const ChromaKey& key, const cv::Mat& background) {
  const cv::Mat wanted = key_image(key, image, background);
  const cv::Mat found =
      key.space == ChromaKey::Space::hsv ? hsv_background(image, wanted, key) : ycrcb_background(image, wanted, key);
  cv::Mat mask = ~found;
  if (key.smooth > 1) cv::medianBlur(mask, mask, key.smooth);
  return mask;
}

CropBox crop_of_mask(const cv::Mat& mask, double margin) {
  const cv::Rect box = cv::boundingRect(mask);
  if (box.area() == 0) return {};
  const int longer = std::max(box.width, box.height);
  const int side = longer + 2 * static_cast<int>(std::ceil(margin * longer));
  const int u0 = box.x - (side - box.width) / 2, v0 = box.y - (side - box.height) / 2;
  return {fit_start(u0, side, mask.cols), fit_start(v0, side, mask.rows), side};
}

cv::Mat crop_mask(const cv::Mat& mask, const CropBox& box, int pixels) {
  return resize_square(cut_window(mask, box, cv::BORDER_REPLICATE), pixels) > 127;
}

cv::Mat crop_image(const cv::Mat& image, const CropBox& box, int pixels) {
  return resize_square(cut_window(image, box, cv::BORDER_CONSTANT), pixels);
}

PinholeCamera crop_camera(const PinholeCamera& camera, const CropBox& box, int pixels) {
  return camera.cropped(box.u0, box.v0, static_cast<double>(pixels) / box.side, pixels, pixels);
}

MaskFacts inspect_mask(const cv::Mat& mask) {
  MaskFacts facts;
  facts.area = cv::countNonZero(mask);
  facts.touches_border = cv::countNonZero(mask.row(0)) + cv::countNonZero(mask.row(mask.rows - 1)) +
                             cv::countNonZero(mask.col(0)) + cv::countNonZero(mask.col(mask.cols - 1)) >
                         0;
  return facts;
}

cv::Mat signed_distance(const cv::Mat& mask) {
  cv::Mat inside, result;  // distance of each inside pixel to the nearest outside one, and the reverse
  cv::distanceTransform(~mask, result, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  result -= 0.5f;
  // The outside pixel that is nearest to an inside one lies at most one pixel beyond the box of the inside pixels.
  const cv::Rect person = cv::boundingRect(mask);
  const cv::Rect box =
      cv::Rect(person.x - 1, person.y - 1, person.width + 2, person.height + 2) & cv::Rect(0, 0, mask.cols, mask.rows);
  cv::distanceTransform(mask(box), inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  for (int row = 0; row < box.height; ++row) {
    const float* in = inside.ptr<float>(row);
    float* to = result.ptr<float>(box.y + row) + box.x;
    for (int column = 0; column < box.width; ++column)
      if (in[column] > 0.0f) to[column] = 0.5f - in[column];
  }
  return result;
}

std::vector<ContourPixel> contour_pixels(const cv::Mat& mask) {
  // The mask beyond the window is unknown, so the window's border is not an outline: the padding repeats the edge.
  cv::Mat padded, eroded;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  cv::erode(padded, eroded, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}));
  const cv::Mat outline = (mask & ~eroded(cv::Rect(1, 1, mask.cols, mask.rows))) / 255;
  cv::Mat counts;
  const int window = 2 * kContourWindow + 1;
  cv::boxFilter(outline, counts, CV_8U, {window, window}, {-1, -1}, false, cv::BORDER_CONSTANT);
  std::vector<ContourPixel> pixels;
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column)
      if (outline.at<std::uint8_t>(row, column) && counts.at<std::uint8_t>(row, column) >= kMinContourInWindow)
        pixels.push_back({static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(row)});
  return pixels;
}

}  // namespace doppel
