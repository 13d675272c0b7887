#include "doppel/detect/blazepose/body_pose.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

constexpr int kValuesPerPoint = 5;
constexpr int kWindowReach = 3;
constexpr double kMinPeak = 0.5;
constexpr std::size_t kNose = 0, kLeftEar = 7, kRightEar = 8, kMouthRight = 10;
constexpr double kDepthOfHiddenNose = 0.02;  // metres behind the ears
constexpr double kTrustOfHidden = 0.1;
constexpr std::size_t kRoiCentrePoint = 33, kRoiRimPoint = 34;

double sigmoid(double logit) { return 1.0 / (1.0 + std::exp(-logit)); }

double heat(std::span<const float> heatmaps, int row, int column, std::size_t point) {
  return sigmoid(heatmaps[as_size(row * kHeatmapPixels + column) * as_size(kNetworkPoints) + point]);
}

/// @param position (0, 0) to (1, 1) over the region
Eigen::Vector2d refined(const Eigen::Vector2d& position, std::span<const float> heatmaps, std::size_t point) {
  const Eigen::Vector2d cell = position * kHeatmapPixels;
  const bool inside = (cell.array() > -1.0).all() && (cell.array() < kHeatmapPixels).all();  // false for NaN, too
  if (!inside) return position;
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
  return peak >= kMinPeak ? Eigen::Vector2d(sum / total / kHeatmapPixels) : position;
}

/// The pixel of a network's point.
Eigen::Vector2d pixel_of(const LandmarkOutputs& outputs, std::size_t point, const BodyRoi& roi) {
  const float* values = &outputs.points[kValuesPerPoint * point];
  const Eigen::Vector2d position = Eigen::Vector2d(values[0], values[1]) / kRoiPixels;
  return roi.image_from_roi(refined(position, outputs.heatmaps, point));
}

/// The landmark on the other side of the body; a landmark in the middle is its own.
std::size_t mirrored_landmark(std::size_t landmark) {
  constexpr std::array<std::size_t, 11> kOfFace = {0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9};
  if (landmark < kOfFace.size()) return kOfFace[landmark];
  return landmark % 2 == 1 ? landmark + 1 : landmark - 1;
}

/// The network's mask as values that are rounded to the image's mask.
class RoiMask {
 public:
  explicit RoiMask(std::span<const float> logits) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int row = std::clamp(y - 1, 0, kRoiPixels - 1), column = std::clamp(x - 1, 0, kRoiPixels - 1);
        const float value = 255.0f / (1.0f + std::exp(-logits[row * kRoiPixels + column]));
        values_[y * kSide + x] = value;
        if (value < 0.5f) continue;
        low = low.min(Eigen::Array2d(column, row) - 0.5);
        high = high.max(Eigen::Array2d(column, row) + 1.5);
      }
    }
    low = low.max(0.0);
    high = high.min(kRoiPixels);
  }

  /// Bilinear; pixels beyond the border repeat it. @param u, v (0, 0) to (256, 256)
  float at(float u, float v) const {
    const float x = u + 0.5f, y = v + 0.5f;
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const float a = x - static_cast<float>(left), b = y - static_cast<float>(top);
    const float *above = &values_[top * kSide + left], *below = above + kSide;
    const float upper = above[0] + a * (above[1] - above[0]), lower = below[0] + a * (below[1] - below[0]);
    return upper + b * (lower - upper);
  }

  /// The rectangle outside of which the rounded mask is 0, in pixels of the region.
  Eigen::Array2d low = Eigen::Array2d::Constant(kRoiPixels), high = Eigen::Array2d::Zero();

 private:
  static constexpr int kSide = kRoiPixels + 2;  ///< the border is repeated once
  std::array<float, kSide * kSide> values_;
};

/// A range of columns, without the last one.
struct Columns {
  int first = 0, last = 0;
};

/// The columns of one row of the image whose coordinate start + column * step lies in [low, high].
Columns columns_between(double start, double step, double low, double high, Columns columns) {
  if (std::abs(step) < 1e-12) return start >= low && start <= high ? columns : Columns();
  const auto [first, last] = std::minmax({(low - start) / step, (high - start) / step});
  const auto clamped = [&](double column) {
    return static_cast<int>(std::clamp<double>(column, columns.first, columns.last));
  };
  return {clamped(std::ceil(first)), clamped(std::floor(last) + 1.0)};
}

}  // namespace

const std::array<const char*, kNumBodyLandmarks> kBodyLandmarkNames = {
    "nose",        "left_eye_inner",  "left_eye",        "left_eye_outer", "right_eye_inner",
    "right_eye",   "right_eye_outer", "left_ear",        "right_ear",      "mouth_left",
    "mouth_right", "left_shoulder",   "right_shoulder",  "left_elbow",     "right_elbow",
    "left_wrist",  "right_wrist",     "left_pinky",      "right_pinky",    "left_index",
    "right_index", "left_thumb",      "right_thumb",     "left_hip",       "right_hip",
    "left_knee",   "right_knee",      "left_ankle",      "right_ankle",    "left_heel",
    "right_heel",  "left_foot_index", "right_foot_index"};

BodyPose decode_pose(const LandmarkOutputs& outputs, const BodyRoi& roi) {
  BodyPose pose;
  pose.score = outputs.presence;
  pose.roi = roi;
  const Eigen::Matrix2d axes = roi.axes();
  for (std::size_t i = 0; i < as_size(kNumBodyLandmarks); ++i) {
    const float* values = &outputs.points[kValuesPerPoint * i];
    const Eigen::Vector2d pixel = pixel_of(outputs, i, roi);
    const std::size_t of_person = roi.mirrored ? mirrored_landmark(i) : i;
    pose.landmarks[of_person] = {pixel.x(), pixel.y(), values[2] / kRoiPixels * roi.side, sigmoid(values[3]),
                                 sigmoid(values[4])};
    const float* metres = &outputs.world[3 * i];
    pose.world[of_person] << axes * Eigen::Vector2d(metres[0], metres[1]), metres[2];
  }
  pose.next_roi = body_roi(pixel_of(outputs, kRoiCentrePoint, roi), pixel_of(outputs, kRoiRimPoint, roi));
  return pose;
}

double landmark_confidence(const BodyPose& pose, std::size_t landmark) {
  const bool is_face = landmark <= kMouthRight && landmark != kLeftEar && landmark != kRightEar;
  const double ears = 0.5 * (pose.world[kLeftEar].z() + pose.world[kRightEar].z());
  const bool hidden = is_face && pose.world[kNose].z() > ears + kDepthOfHiddenNose;
  return (hidden ? kTrustOfHidden : 1.0) * pose.landmarks[landmark].visibility;
}

BodyPose mean_pose(const BodyPose& first, const BodyPose& second) {
  BodyPose mean = first;
  for (std::size_t i = 0; i < as_size(kNumBodyLandmarks); ++i) {
    const BodyLandmark &a = first.landmarks[i], &b = second.landmarks[i];
    mean.landmarks[i] = {0.5 * (a.x + b.x), 0.5 * (a.y + b.y), 0.5 * (a.z + b.z), 0.5 * (a.visibility + b.visibility),
                         0.5 * (a.presence + b.presence)};
    mean.world[i] = 0.5 * (first.world[i] + second.world[i]);
  }
  return mean;
}

cv::Mat draw_person_mask(std::span<const float> logits, const BodyRoi& roi, cv::Size image) {
  const RoiMask mask(logits);
  cv::Mat result(image, CV_8U, cv::Scalar(0));
  const Eigen::Vector2d origin = roi.roi_from_image({0, 0}) * kRoiPixels;
  const Eigen::Vector2d right = roi.roi_from_image({1, 0}) * kRoiPixels - origin;
  const Eigen::Vector2d down = roi.roi_from_image({0, 1}) * kRoiPixels - origin;
  for (int row = 0; row < image.height; ++row) {
    const Eigen::Vector2d start = origin + (row + 0.5) * down + 0.5 * right;
    Columns columns{0, image.width};
    for (const int axis : {0, 1})
      columns = columns_between(start[axis], right[axis], mask.low[axis], mask.high[axis], columns);
    std::uint8_t* pixels = result.ptr(row);
    for (int column = columns.first; column < columns.last; ++column) {
      const auto u = static_cast<float>(start.x() + column * right.x());
      const auto v = static_cast<float>(start.y() + column * right.y());
      pixels[column] = static_cast<std::uint8_t>(mask.at(u, v) + 0.5f);
    }
  }
  return result;
}

}  // namespace doppel
