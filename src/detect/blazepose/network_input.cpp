#include "doppel/detect/blazepose/network_input.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

/// The two pixels next to a coordinate, and how much the second one counts. Beyond the border both are its pixel.
struct Taps {
  int first = 0, second = 0;
  float weight = 0.0f;
};

/// @param coordinate in pixels, pixel centres at +0.5; size > 0
inline Taps taps_at(float coordinate, int size) {
  const float position = std::clamp(coordinate - 0.5f, 0.0f, static_cast<float>(size - 1));
  const int first = static_cast<int>(position);
  return {first, std::min(first + 1, size - 1), position - static_cast<float>(first)};
}

/// Writes one sample of a BGR image as RGB: scale * value + offset.
inline void sample(const cv::Mat& image, const Taps& x, const Taps& y, float scale, float offset, float* rgb) {
  const std::uint8_t *above = image.ptr(y.first), *below = image.ptr(y.second);
  for (int c = 0; c < 3; ++c) {
    const float a = above[3 * x.first + c], b = above[3 * x.second + c];
    const float d = below[3 * x.first + c], e = below[3 * x.second + c];
    const float top = a + x.weight * (b - a), bottom = d + x.weight * (e - d);
    rgb[2 - c] = scale * (top + y.weight * (bottom - top)) + offset;
  }
}

}  // namespace

void require_image(const cv::Mat& image) {
  if (image.empty() || image.dims != 2 || image.type() != CV_8UC3)
    fail<UsageError>(
        "detecting people: found an image of {}x{} pixels with {} channels of {} bytes; allowed is 8-bit "
        "BGR with at least one pixel",
        image.cols, image.rows, image.channels(), image.elemSize1());
}

Letterbox letterbox_of(cv::Size image) {
  const double side = std::max(image.width, image.height);
  return {side, 0.5 * (image.width - side), 0.5 * (image.height - side)};
}

void sample_letterbox(const cv::Mat& image, int pixels, std::span<float> result) {
  const Letterbox box = letterbox_of(image.size());
  const double step = box.side / pixels;
  for (int row = 0; row < pixels; ++row) {
    const double v = box.top + (row + 0.5) * step;
    const Taps y = taps_at(static_cast<float>(v), image.rows);
    for (int column = 0; column < pixels; ++column) {
      const double u = box.left + (column + 0.5) * step;
      float* rgb = result.data() + 3 * (as_size(row) * as_size(pixels) + as_size(column));
      if (u < 0 || v < 0 || u > image.cols || v > image.rows) {
        std::fill(rgb, rgb + 3, -1.0f);
      } else {
        sample(image, taps_at(static_cast<float>(u), image.cols), y, 2.0f / 255.0f, -1.0f, rgb);
      }
    }
  }
}

void sample_roi(const cv::Mat& image, const BodyRoi& roi, int pixels, std::span<float> result) {
  const Eigen::Vector2d origin = roi.image_from_roi({0, 0});
  const Eigen::Vector2d right = (roi.image_from_roi({1, 0}) - origin) / pixels;
  const Eigen::Vector2d down = (roi.image_from_roi({0, 1}) - origin) / pixels;
  for (int row = 0; row < pixels; ++row) {
    const Eigen::Vector2d start = origin + (row + 0.5) * down;
    float* rgb = result.data() + 3 * as_size(row) * as_size(pixels);
    for (int column = 0; column < pixels; ++column, rgb += 3) {
      const auto u = static_cast<float>(start.x() + (column + 0.5) * right.x());
      const auto v = static_cast<float>(start.y() + (column + 0.5) * right.y());
      sample(image, taps_at(u, image.cols), taps_at(v, image.rows), 1.0f / 255.0f, 0.0f, rgb);
    }
  }
}

}  // namespace doppel
