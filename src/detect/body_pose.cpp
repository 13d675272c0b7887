#include "doppel/detect/body_pose.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

constexpr int kValuesPerPoint = 5;
constexpr int kWindowReach = 3;
constexpr double kMinPeak = 0.5;
constexpr std::size_t kRoiCentrePoint = 33, kRoiRimPoint = 34;

double sigmoid(double logit) { return 1.0 / (1.0 + std::exp(-logit)); }

double heat(std::span<const float> heatmaps, int row, int column, std::size_t point) {
  return sigmoid(heatmaps[as_size(row * kHeatmapPixels + column) * as_size(kNetworkPoints) + point]);
}

/// @param place (0, 0) to (1, 1) over the region
Eigen::Vector2d refined(const Eigen::Vector2d& place, std::span<const float> heatmaps, std::size_t point) {
  const Eigen::Vector2d cell = place * kHeatmapPixels;
  const bool inside = (cell.array() > -1.0).all() && (cell.array() < kHeatmapPixels).all();  // false for NaN, too
  if (!inside) return place;
  const int column = static_cast<int>(cell.x()), row = static_cast<int>(cell.y());
  const auto low = [](int centre) { return std::max(0, centre - kWindowReach); };
  const auto high = [](int centre) { return std::min(kHeatmapPixels - 1, centre + kWindowReach); };
  double total = 0.0, peak = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int y = low(row); y <= high(row); ++y) {
    for (int x = low(column); x <= high(column); ++x) {
      const double weight = heat(heatmaps, y, x, point);
      total += weight;
      peak = std::max(peak, weight);
      sum += weight * Eigen::Vector2d(x, y);
    }
  }
  return peak >= kMinPeak ? Eigen::Vector2d(sum / total / kHeatmapPixels) : place;
}

/// The pixel of a network's point.
Eigen::Vector2d pixel_of(const LandmarkOutputs& outputs, std::size_t point, const BodyRoi& roi) {
  const float* values = &outputs.points[kValuesPerPoint * point];
  const Eigen::Vector2d place = Eigen::Vector2d(values[0], values[1]) / kRoiPixels;
  return roi.image_from_roi(refined(place, outputs.heatmaps, point));
}

/// The network's mask, sampled at (0, 0) to (256, 256); pixels beyond its border repeat it.
float sample_mask(const std::array<float, kRoiPixels * kRoiPixels>& mask, float u, float v) {
  constexpr float kLast = kRoiPixels - 1;
  const float x = std::clamp(u - 0.5f, 0.0f, kLast), y = std::clamp(v - 0.5f, 0.0f, kLast);
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const int right = std::min(left + 1, kRoiPixels - 1), bottom = std::min(top + 1, kRoiPixels - 1);
  const float a = x - static_cast<float>(left), b = y - static_cast<float>(top);
  const float *above = &mask[as_size(top * kRoiPixels)], *below = &mask[as_size(bottom * kRoiPixels)];
  const float high = above[left] + a * (above[right] - above[left]);
  const float low = below[left] + a * (below[right] - below[left]);
  return high + b * (low - high);
}

/// The columns of one row of the image whose coordinate start + column * step lies in [0, 256]: [first, last).
std::pair<int, int> columns_inside(double start, double step, std::pair<int, int> columns) {
  if (std::abs(step) < 1e-12) return start >= 0.0 && start <= kRoiPixels ? columns : std::pair(0, 0);
  double low = -start / step, high = (kRoiPixels - start) / step;
  if (low > high) std::swap(low, high);
  const auto clamped = [&](double column) {
    return static_cast<int>(std::clamp<double>(column, columns.first, columns.second));
  };
  return {clamped(std::ceil(low)), clamped(std::floor(high) + 1.0)};
}

}  // namespace

const std::array<const char*, kNumBodyLandmarks> kBodyLandmarkNames = {
    "nose",          "left_eye_inner", "left_eye",         "left_eye_outer", "right_eye_inner", "right_eye",
    "right_eye_outer", "left_ear",     "right_ear",        "mouth_left",     "mouth_right",     "left_shoulder",
    "right_shoulder", "left_elbow",    "right_elbow",      "left_wrist",     "right_wrist",     "left_pinky",
    "right_pinky",   "left_index",     "right_index",      "left_thumb",     "right_thumb",     "left_hip",
    "right_hip",     "left_knee",      "right_knee",       "left_ankle",     "right_ankle",     "left_heel",
    "right_heel",    "left_foot_index", "right_foot_index"};

BodyPose decode_pose(const LandmarkOutputs& outputs, const BodyRoi& roi) {
  BodyPose pose;
  pose.score = outputs.presence;
  pose.roi = roi;
  const Eigen::Matrix2d turn = roi.turn();
  for (std::size_t i = 0; i < as_size(kNumBodyLandmarks); ++i) {
    const float* values = &outputs.points[kValuesPerPoint * i];
    const Eigen::Vector2d pixel = pixel_of(outputs, i, roi);
    pose.landmarks[i] = {pixel.x(), pixel.y(), values[2] / kRoiPixels * roi.side, sigmoid(values[3]),
                         sigmoid(values[4])};
    const float* metres = &outputs.world[3 * i];
    pose.world[i] << turn * Eigen::Vector2d(metres[0], metres[1]), metres[2];
  }
  pose.next_roi = body_roi(pixel_of(outputs, kRoiCentrePoint, roi), pixel_of(outputs, kRoiRimPoint, roi));
  return pose;
}

cv::Mat draw_person_mask(std::span<const float> logits, const BodyRoi& roi, cv::Size image) {
  std::array<float, kRoiPixels * kRoiPixels> mask;
  std::transform(logits.begin(), logits.end(), mask.begin(), [](float logit) { return 255.0f / (1.0f + std::exp(-logit)); });
  cv::Mat result(image, CV_8U, cv::Scalar(0));
  const Eigen::Vector2d origin = roi.roi_from_image({0, 0}) * kRoiPixels;
  const Eigen::Vector2d right = roi.roi_from_image({1, 0}) * kRoiPixels - origin;
  const Eigen::Vector2d down = roi.roi_from_image({0, 1}) * kRoiPixels - origin;
  for (int row = 0; row < image.height; ++row) {
    const Eigen::Vector2d start = origin + (row + 0.5) * down + 0.5 * right;
    const auto inside = columns_inside(start.x(), right.x(), {0, image.width});
    const auto [first, last] = columns_inside(start.y(), right.y(), inside);
    std::uint8_t* pixels = result.ptr(row);
    for (int column = first; column < last; ++column) {
      const auto u = static_cast<float>(start.x() + column * right.x());
      const auto v = static_cast<float>(start.y() + column * right.y());
      pixels[column] = static_cast<std::uint8_t>(sample_mask(mask, u, v) + 0.5f);
    }
  }
  return result;
}

}  // namespace doppel
