#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel::test_keypoints {

/// The points of a layout on a person of 1.75 m who stands at the origin and looks along +z, world metres, y up. The
/// person's left is +x. Points of the face, the fingers and the like are left out.
inline std::vector<std::optional<Eigen::Vector3d>> standing_body(const PointLayout& layout) {
  static const std::map<std::string, Eigen::Vector3d> middle{
      {"nose", {0, 1.60, 0.10}}, {"neck", {0, 1.45, 0}},   {"thorax", {0, 1.45, 0}}, {"neckbase", {0, 1.55, 0.05}},
      {"headtop", {0, 1.75, 0}}, {"midhip", {0, 0.95, 0}}, {"spine", {0, 1.20, 0}}};
  static const std::map<std::string, Eigen::Vector3d> left{
      {"eye", {0.03, 1.63, 0.08}},    {"ear", {0.08, 1.61, 0}},         {"shoulder", {0.19, 1.43, 0}},
      {"elbow", {0.32, 1.18, -0.05}}, {"wrist", {0.36, 0.95, 0.06}},    {"hip", {0.11, 0.95, 0}},
      {"knee", {0.12, 0.52, 0.03}},   {"ankle", {0.12, 0.10, -0.02}},   {"foot", {0.12, 0.10, -0.02}},
      {"bigtoe", {0.13, 0.03, 0.20}}, {"smalltoe", {0.18, 0.03, 0.16}}, {"heel", {0.12, 0.03, -0.07}}};
  std::vector<std::optional<Eigen::Vector3d>> body;
  for (const std::string& name : layout.points) {
    const std::string key = landmark_key(name);
    const bool is_left = key.starts_with("left_"), is_right = key.starts_with("right_");
    const auto& part = is_left || is_right ? left : middle;
    const auto found = part.find(key.substr(is_left ? 5 : is_right ? 6 : 0));
    body.emplace_back();
    if (found == part.end()) continue;
    body.back() = found->second;
    if (is_right) body.back()->x() *= -1;
  }
  return body;
}

}  // namespace doppel::test_keypoints
