#include "doppel/detect/blazepose/body_boxes.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/detect/blazepose/network_input.h"

namespace doppel {

namespace {

constexpr double kMinBoxScore = 0.5;
constexpr double kSamePerson = 0.3;
constexpr float kMaxScoreLogit = 100.0f;

double overlap(const BodyBox& a, const BodyBox& b) {
  const Eigen::Vector2d low = a.corner.cwiseMax(b.corner);
  const Eigen::Vector2d high = (a.corner + a.size).cwiseMin(b.corner + b.size);
  const Eigen::Vector2d common = (high - low).cwiseMax(0.0);
  const double shared = common.prod(), whole = a.size.prod() + b.size.prod() - shared;
  return whole > 0.0 ? shared / whole : 0.0;
}

/// @param values [12] of one anchor
BodyBox decode_box(const float* values, const Eigen::Vector2d& anchor, double score) {
  const auto pair = [&](int first) {
    return Eigen::Vector2d(Eigen::Vector2d(values[first], values[first + 1]) / kDetectorPixels);
  };
  BodyBox box;
  box.score = score;
  box.size = pair(2);
  box.corner = pair(0) + anchor - 0.5 * box.size;
  for (int k = 0; k < 4; ++k) box.keypoints[k] = pair(4 + 2 * k) + anchor;
  return box;
}

BodyBox weighted_mean(const std::vector<BodyBox>& boxes) {
  BodyBox mean;
  double total = 0.0;
  for (Eigen::Vector2d& point : mean.keypoints) point.setZero();
  for (const BodyBox& box : boxes) {
    total += box.score;
    mean.corner += box.score * box.corner;
    mean.size += box.score * box.size;
    for (std::size_t k = 0; k < 4; ++k) mean.keypoints[k] += box.score * box.keypoints[k];
  }
  mean.corner /= total;
  mean.size /= total;
  for (Eigen::Vector2d& point : mean.keypoints) point /= total;
  return mean;
}

}  // namespace

std::vector<Eigen::Vector2d> detector_anchors() {
  std::vector<Eigen::Vector2d> anchors;
  for (const auto& [cells, per_cell] : {std::pair(28, 2), std::pair(14, 2), std::pair(7, 6)}) {
    for (int row = 0; row < cells; ++row)
      for (int column = 0; column < cells; ++column)
        anchors.insert(anchors.end(), as_size(per_cell), {(column + 0.5) / cells, (row + 0.5) / cells});
  }
  return anchors;
}

std::vector<BodyBox> decode_boxes(std::span<const float> values, std::span<const float> scores) {
  static const std::vector<Eigen::Vector2d> anchors = detector_anchors();
  std::vector<BodyBox> boxes;
  for (std::size_t i = 0; i < anchors.size(); ++i) {
    const double logit = std::clamp(scores[i], -kMaxScoreLogit, kMaxScoreLogit);
    const double score = 1.0 / (1.0 + std::exp(-logit));
    const std::span<const float> box = values.subspan(kDetectorValues * i, kDetectorValues);
    const bool finite = std::all_of(box.begin(), box.end(), [](float value) { return std::isfinite(value); });
    if (score >= kMinBoxScore && finite) boxes.push_back(decode_box(box.data(), anchors[i], score));
  }
  return boxes;
}

std::vector<BodyBox> merge_boxes(std::vector<BodyBox> boxes) {
  std::stable_sort(boxes.begin(), boxes.end(), [](const BodyBox& a, const BodyBox& b) { return a.score > b.score; });
  std::vector<BodyBox> people;
  while (!boxes.empty()) {
    const BodyBox best = boxes.front();
    const auto others = std::stable_partition(boxes.begin() + 1, boxes.end(),
                                              [&](const BodyBox& box) { return overlap(best, box) > kSamePerson; });
    people.push_back(weighted_mean({boxes.begin(), others}));
    people.back().score = best.score;
    boxes.erase(boxes.begin(), others);
  }
  return people;
}

BodyBox box_in_image(const BodyBox& box, cv::Size image) {
  const Letterbox letterbox = letterbox_of(image);
  const Eigen::Vector2d origin(letterbox.left, letterbox.top);
  BodyBox result = box;
  result.corner = origin + letterbox.side * box.corner;
  result.size = letterbox.side * box.size;
  for (Eigen::Vector2d& point : result.keypoints) point = origin + letterbox.side * point;
  return result;
}

}  // namespace doppel
