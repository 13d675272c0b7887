#include "doppel/eval/hand_boxes.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "doppel/character/landmarks.h"

namespace doppel {

namespace {

constexpr double kHalfSide = 0.12;  // metres

}  // namespace

HandBoxes::HandBoxes(const Dataset& dataset, const Skeleton& skeleton) : dataset_(dataset), skeleton_(skeleton) {
  std::copy_if(skeleton_.markers.begin(), skeleton_.markers.end(), std::back_inserter(knuckles_),
               [](const Marker& marker) {
                 return marker.name == "left_middle_finger1" || marker.name == "right_middle_finger1";
               });
}

std::vector<cv::Rect> HandBoxes::find(const SampleId& sample, int camera_index) const {
  const Motion& motion = dataset_.sequences()[static_cast<std::size_t>(sample.sequence)].motion;
  if (static_cast<std::size_t>(sample.frame) >= motion.frames.size()) return {};
  const PinholeCamera& camera = dataset_.camera(camera_index);
  std::vector<cv::Rect> boxes;
  for (const Eigen::Vector3d& world :
       landmark_positions(skeleton_, knuckles_, motion.frames[static_cast<std::size_t>(sample.frame)])) {
    const double depth = camera.camera_from_world(world).z();
    if (!(depth > kHalfSide)) continue;
    const Eigen::Vector2d pixel = camera.project(world);
    const double half = kHalfSide * camera.K(0, 0) / depth;
    const cv::Rect box(
        cv::Point(static_cast<int>(std::floor(pixel.x() - half)), static_cast<int>(std::floor(pixel.y() - half))),
        cv::Size(static_cast<int>(std::ceil(2 * half)), static_cast<int>(std::ceil(2 * half))));
    if (const cv::Rect inside = box & cv::Rect(0, 0, camera.width, camera.height); !inside.empty())
      boxes.push_back(inside);
  }
  return boxes;
}

}  // namespace doppel
