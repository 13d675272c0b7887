#include "doppel/detect/masks/tiled_mixtures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel {
namespace {

constexpr int kHistory = 500;
constexpr int kTile = 64;          // pixels
constexpr double kRounding = 0.9;  // of the mean colour to 8 bits, in three channels
constexpr int kMedian = 3;         // side of the window in which a single pixel counts as noise

}  // namespace

TiledMixtures::TiledMixtures(double threshold, double shadow, cv::Size size) : size_(size) {
  for (int row = 0; row < size.height; row += kTile)
    for (int column = 0; column < size.width; column += kTile) {
      tiles_.push_back({cv::Rect(column, row, kTile, kTile) & cv::Rect({}, size),
                        cv::createBackgroundSubtractorMOG2(kHistory, threshold * threshold, shadow < 1.0)});
      tiles_.back().model->setShadowThreshold(shadow);
    }
  const double nearest = threshold * std::sqrt(tiles_.front().model->getVarMin()) - kRounding;
  sure_ = static_cast<int>(std::pow(std::max(0.0, nearest), 2));
}

void TiledMixtures::learn(const cv::Mat& image, double rate) {
  cv::Mat ignored;
  for (const Tile& tile : tiles_) tile.model->apply(image(tile.box), ignored, rate);
}

cv::Mat TiledMixtures::empty_scene() const {
  cv::Mat scene(size_, CV_8UC3), part;
  for (const Tile& tile : tiles_) {
    tile.model->getBackgroundImage(part);
    part.copyTo(scene(tile.box));
  }
  return scene;
}

cv::Mat TiledMixtures::classes(const cv::Mat& image, const cv::Mat& empty) const {
  const cv::Mat far = far_from(image, empty);
  cv::Mat found = cv::Mat::zeros(size_, CV_8U), part;
  for (const Tile& tile : tiles_) {
    // One pixel more than the tile: a median at its edge sees them too.
    const cv::Rect around(tile.box.x - 1, tile.box.y - 1, tile.box.width + 2, tile.box.height + 2);
    if (cv::countNonZero(far(around & cv::Rect({}, size_))) == 0) continue;
    tile.model->apply(image(tile.box), part, 0.0);
    part.copyTo(found(tile.box));
  }
  return found;
}

/// Pixels that may not match the scene, without single ones.
cv::Mat TiledMixtures::far_from(const cv::Mat& image, const cv::Mat& empty) const {
  cv::Mat far(size_, CV_8U);
  for (int row = 0; row < image.rows; ++row) {
    const std::uint8_t *a = image.ptr(row), *b = empty.ptr(row);
    std::uint8_t* out = far.ptr(row);
    for (int i = 0; i < image.cols; ++i) {
      const int x = a[3 * i] - b[3 * i], y = a[3 * i + 1] - b[3 * i + 1], z = a[3 * i + 2] - b[3 * i + 2];
      out[i] = x * x + y * y + z * z > sure_ ? 255 : 0;
    }
  }
  cv::medianBlur(far, far, kMedian);
  return far;
}

}  // namespace doppel
