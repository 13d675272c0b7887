#include "doppel/data/capture/pose_detector.h"

#include "doppel/core/error.h"

namespace doppel {

PoseDetector::PoseDetector(const PersonNetworkOptions& options, const PointLayout& layout)
    : network_(options, static_cast<int>(layout.points.size())), model_(options.network.model) {}

People PoseDetector::detect(const cv::Mat& image) {
  const std::optional<PersonFinding> found = network_.find(image);
  mask_ = found ? found->mask : cv::Mat();
  if (!found) return {};
  if (found->points.empty())
    fail(
        "{}: the detector finds a mask, but keypoints are needed; name a network for points, and this one as its "
        "`mask`",
        model_.string());
  Person person;
  for (const NetworkPoint& point : found->points) {
    const bool seen = point.score > 0.0;
    person.push_back(seen ? Keypoint{static_cast<float>(point.position.x()), static_cast<float>(point.position.y()),
                                     static_cast<float>(point.score)}
                          : Keypoint{});
  }
  return {person};
}

}  // namespace doppel
