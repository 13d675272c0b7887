#include "doppel/eval/hand_boxes.h"

#include <algorithm>
#include <cmath>

#include "doppel/character/character_folder.h"

namespace doppel {

namespace {

constexpr double kHalfSide = 0.12;  // metres

std::optional<Marker> marker_named(const Skeleton& skeleton, const std::string& name) {
  const auto found = std::find_if(skeleton.markers.begin(), skeleton.markers.end(),
                                  [&](const Marker& marker) { return marker.name == name; });
  return found == skeleton.markers.end() ? std::nullopt : std::optional<Marker>(*found);
}

}  // namespace

HandBoxes::HandBoxes(const Dataset& dataset)
    : dataset_(dataset),
      character_(load_character(dataset.character_path())),
      knuckles_{marker_named(character_.skeleton, "left_middle_finger1"),
                marker_named(character_.skeleton, "right_middle_finger1")} {}

std::vector<cv::Rect> HandBoxes::find(const SampleId& sample, int camera_index) const {
  const Motion& motion = dataset_.sequences()[static_cast<std::size_t>(sample.sequence)].motion;
  if (static_cast<std::size_t>(sample.frame) >= motion.frames.size()) return {};
  const auto world_from_joint = character_.skeleton.pose(motion.frames.at(static_cast<std::size_t>(sample.frame)));
  const PinholeCamera& camera = dataset_.camera(camera_index);
  std::vector<cv::Rect> boxes;
  for (const std::optional<Marker>& knuckle : knuckles_) {
    const Eigen::Vector3d world = world_from_joint[static_cast<std::size_t>(knuckle->joint)] * knuckle->position;
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
