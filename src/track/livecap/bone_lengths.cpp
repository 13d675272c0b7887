#include "doppel/track/livecap/bone_lengths.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr double kMinLength = 1e-6;  // metres; a shorter bone has no direction

}  // namespace

LandmarkTree::LandmarkTree(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                           const std::vector<double>& rest_dofs)
    : parent_(landmarks.size(), -1) {
  const std::vector<Eigen::Affine3d> rest = skeleton.pose(rest_dofs);
  const auto rides_on = [&](int joint) {
    for (std::size_t m = 0; m < landmarks.size(); ++m)
      if (landmarks[m].joint == joint) return static_cast<int>(m);
    return -1;
  };
  const auto to_root = [&](std::size_t m) {
    const Marker& landmark = landmarks[m];
    return (rest[landmark.joint] * landmark.position - rest.front().translation()).norm();
  };
  for (std::size_t m = 1; m < landmarks.size(); ++m)
    if (to_root(m) < to_root(as_size(root_))) root_ = static_cast<int>(m);
  std::vector<std::pair<int, int>> depth_of;  // (depth, landmark)
  for (std::size_t m = 0; m < landmarks.size(); ++m) {
    const auto parent_joint = [&](int joint) { return skeleton.joints[joint].parent; };
    int depth = 0;
    for (int j = parent_joint(landmarks[m].joint); j >= 0; j = parent_joint(j), ++depth)
      if (parent_[m] < 0) parent_[m] = rides_on(j);
    if (parent_[m] < 0) parent_[m] = root_;
    if (static_cast<int>(m) == root_) parent_[m] = depth = -1;
    depth_of.emplace_back(depth, static_cast<int>(m));
  }
  std::sort(depth_of.begin(), depth_of.end());
  for (const auto& [depth, landmark] : depth_of) order_.push_back(landmark);
}

std::vector<std::optional<Eigen::Vector3d>> LandmarkTree::with_lengths_of(
    std::vector<std::optional<Eigen::Vector3d>> joints, const std::vector<Eigen::Vector3d>& body) const {
  const std::vector<std::optional<Eigen::Vector3d>> detected = joints;
  for (const int landmark : order_) {
    const auto m = as_size(landmark);
    int above = parent_[m];
    while (above >= 0 && !joints[above]) above = parent_[above];
    if (above < 0 || !joints[m]) continue;
    const auto a = as_size(above);
    const Eigen::Vector3d bone = *detected[m] - *detected[a];
    if (bone.norm() > kMinLength) joints[m] = *joints[a] + (body[m] - body[a]).norm() / bone.norm() * bone;
  }
  return joints;
}

}  // namespace doppel
