#include "doppel/character/bone_scales.h"

#include <algorithm>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/lower_case.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// A name without its side, in lower case: `LeftForeArm` and `RightForeArm`, `l_knee` and `r_knee` become the same.
std::string without_side(const std::string& name) {
  std::string lower = lower_case(name);
  for (const std::string side : {"left", "right"})
    if (const auto at = lower.find(side); at != std::string::npos) return lower.erase(at, side.size());
  const auto is_side = [](char letter, char separator) {
    return (letter == 'l' || letter == 'r') && std::string("_-. ").find(separator) != std::string::npos;
  };
  const std::size_t size = lower.size();
  if (size > 2 && is_side(lower[0], lower[1])) return lower.substr(2);
  if (size > 2 && is_side(lower[size - 1], lower[size - 2])) return lower.substr(0, size - 2);
  return lower;
}

}  // namespace

BoneScales::BoneScales(const Character& character)
    : character_(character),
      rest_(character.skeleton.pose(character.rest_dofs)),
      group_(character.skeleton.joints.size()),
      group_bones_(character.skeleton.joints.size()) {
  std::map<std::string, int> parameter_of;
  const std::vector<Joint>& joints = character.skeleton.joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const int parent = joints[j].parent;
    const double length = joints[j].offset.norm();
    group_[j] = parent >= 0 && length == 0.0 ? group_[parent] : static_cast<int>(j);
    if (parent < 0 || length < kMinLength) continue;
    const std::string name = without_side(bone_name(joints[j].name));
    const auto [entry, added] = parameter_of.emplace(name, num_parameters());
    if (added) parameters_.push_back({name, 1.0, 0.1, 0.4, 2.5});
    group_bones_[group_[parent]].push_back(static_cast<int>(bones_.size()));
    const Eigen::Affine3d& start = rest_[parent];
    bones_.push_back(
        {static_cast<int>(j), entry->second, start.translation(), start.linear() * joints[j].offset / length, length});
  }
  if (bones_.empty()) fail("{} has no bone of {} m or more whose length could be scaled", character.name, kMinLength);
}

/// How the bones that start at a group move a point of the group, without the motion of the group itself.
Vector3d BoneScales::stretch(int group, const Vector3d& p, std::span<const double> factors) const {
  Vector3d sum = Vector3d::Zero();
  for (const int b : group_bones_[group]) {
    const Bone& bone = bones_[b];
    const double along = std::clamp(bone.direction.dot(p - bone.start), 0.0, bone.length);
    sum += (factors[bone.parameter] - 1.0) * along * bone.direction;
  }
  return sum;
}

void BoneScales::move_markers(std::span<const double> factors, Skeleton& skeleton) const {
  for (Marker& marker : skeleton.markers) {
    const auto j = as_size(marker.joint);
    const Vector3d p = rest_[j] * marker.position;
    marker.position += rest_[j].linear().transpose() * stretch(group_[j], p, factors);
  }
}

Character BoneScales::character(std::span<const double> values) const {
  if (values.size() != parameters_.size())
    fail<UsageError>("{} has {} bones with a length, not {}", character_.name, parameters_.size(), values.size());
  Character scaled = character_;
  for (const Bone& bone : bones_) scaled.skeleton.joints[bone.joint].offset *= values[bone.parameter];
  const std::vector<Eigen::Affine3d> moved = scaled.skeleton.pose(scaled.rest_dofs);
  std::vector<Vector3d> shift;
  for (std::size_t j = 0; j < moved.size(); ++j) shift.push_back(moved[j].translation() - rest_[j].translation());
  for (int v = 0; v < character_.num_vertices(); ++v) {
    const Vector3d& p = character_.mesh.vertices[v];
    const auto bones = character_.skin.vertex_bones.row(v);
    const auto weights = character_.skin.vertex_bones.row_of(character_.skin.weights, v);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t i = 0; i < bones.size(); ++i) {
      const int joint = character_.bone_joint[bones[i]];
      sum += weights[i] * (shift[joint] + stretch(group_[joint], p, values));
    }
    scaled.mesh.vertices[v] = p + sum;
  }
  move_markers(values, scaled.skeleton);
  return scaled;
}

}  // namespace doppel
