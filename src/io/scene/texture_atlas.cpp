#include "doppel/io/scene/texture_atlas.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr int kBorder = 4;

}  // namespace

TextureAtlas::TextureAtlas(std::vector<cv::Mat> images, int largest_side) {
  const auto area = [&] {
    double sum = 0.0;
    for (const cv::Mat& image : images) sum += double(image.cols + 2 * kBorder) * (image.rows + 2 * kBorder);
    return sum;
  };
  for (;;) {
    int widest = 0;
    for (const cv::Mat& image : images) widest = std::max(widest, image.cols + 2 * kBorder);
    const int width = std::max(widest, static_cast<int>(std::ceil(std::sqrt(area()) * 1.1)));
    if (width <= largest_side && pack(images, width, largest_side)) break;
    const bool smallest = std::all_of(images.begin(), images.end(),
                                      [](const cv::Mat& image) { return image.cols == 1 && image.rows == 1; });
    if (smallest)
      fail("{} textures and colours do not fit into one image of {} x {} pixels; join materials before", images.size(),
           largest_side, largest_side);
    for (cv::Mat& image : images) {
      const cv::Size smaller(std::max(1, image.cols * 4 / 5), std::max(1, image.rows * 4 / 5));
      cv::Mat resized;
      cv::resize(image, resized, smaller, 0, 0, cv::INTER_AREA);
      image = resized;
    }
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    const cv::Rect& inside = rectangles_[i];
    cv::Mat bordered;
    cv::copyMakeBorder(images[i], bordered, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REPLICATE);
    bordered.copyTo(image_(cv::Rect(inside.x - kBorder, inside.y - kBorder, bordered.cols, bordered.rows)));
  }
}

/// Rows of images, the highest first.
bool TextureAtlas::pack(const std::vector<cv::Mat>& images, int width, int largest_side) {
  std::vector<std::size_t> order(images.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return images[a].rows > images[b].rows; });
  rectangles_.assign(images.size(), cv::Rect());
  int x = 0, y = 0, row = 0;
  for (const std::size_t i : order) {
    const int w = images[i].cols + 2 * kBorder, h = images[i].rows + 2 * kBorder;
    if (x + w > width) {
      x = 0;
      y += row;
      row = 0;
    }
    rectangles_[i] = cv::Rect(x + kBorder, y + kBorder, images[i].cols, images[i].rows);
    x += w;
    row = std::max(row, h);
  }
  if (y + row > largest_side) return false;
  image_ = cv::Mat(y + row, width, CV_8UC3, cv::Scalar::all(0));
  return true;
}

Eigen::Vector2d TextureAtlas::place(std::size_t i, const Eigen::Vector2d& uv) const {
  const cv::Rect& inside = rectangles_[i];
  const double x = inside.x + uv.x() * inside.width, y = inside.y + (1 - uv.y()) * inside.height;
  return {x / image_.cols, 1 - y / image_.rows};
}

}  // namespace doppel
