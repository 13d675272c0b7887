#include "doppel/character/skeleton.h"

#include <cmath>
#include <utility>

#include "doppel/core/error.h"

namespace doppel {

namespace {

template <typename Item>
std::optional<int> find_by_name(const std::vector<Item>& items, const std::string& name) {
  for (std::size_t i = 0; i < items.size(); ++i)
    if (items[i].name == name) return static_cast<int>(i);
  return std::nullopt;
}

bool carries(const std::string& joint, const std::string& bone, BoneRule rule) {
  if (rule == BoneRule::prefix) return joint.compare(0, bone.size(), bone) == 0;
  return joint.substr(0, joint.find('_')) == bone;
}

Eigen::Affine3d joint_motion(const Joint& joint, double q) {
  if (joint.type == Joint::Type::prismatic) return Eigen::Affine3d(Eigen::Translation3d(joint.axis * q));
  return Eigen::Affine3d(Eigen::AngleAxisd(q, joint.axis));
}

/// One moving axis of the root chain: the joint and the DoF that drives it.
struct RootAxis {
  int joint, dof;
  double weight;
};

std::optional<RootAxis> drive_of(const Skeleton& skeleton, int joint) {
  std::optional<RootAxis> found;
  for (int d = 0; d < skeleton.num_dofs(); ++d)
    for (const Dof::Drive& drive : skeleton.dofs[d].joints) {
      if (drive.joint != joint || drive.weight == 0.0) continue;
      if (found)
        fail("the root joint '{}' is driven by two DoFs, '{}' and '{}'; the root needs a single DoF per joint",
             skeleton.joints[joint].name, skeleton.dofs[found->dof].name, skeleton.dofs[d].name);
      found = RootAxis{joint, d, drive.weight};
    }
  return found;
}

/// The next joint of the root chain: the child of the given type, or else a child that no DoF drives.
std::optional<int> next_in_chain(const Skeleton& skeleton, int parent, Joint::Type type) {
  std::optional<int> idle;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    if (skeleton.joints[j].parent != parent) continue;
    const bool driven = drive_of(skeleton, j).has_value();
    if (driven && skeleton.joints[j].type == type) return j;
    if (!driven && !idle) idle = j;
  }
  return idle;
}

/// The six driven joints below (and including) the skeleton's root.
std::vector<RootAxis> root_chain(const Skeleton& skeleton) {
  std::vector<RootAxis> chain;
  int parent = -1;
  while (chain.size() < 6) {
    const Joint::Type type = chain.size() < 3 ? Joint::Type::prismatic : Joint::Type::revolute;
    const std::optional<int> joint = next_in_chain(skeleton, parent, type);
    if (!joint)
      fail(
          "the skeleton's root must be three translations followed by three rotations, each driven by a DoF; after {} "
          "of "
          "them no {} joint follows below '{}'",
          chain.size(), type == Joint::Type::prismatic ? "prismatic" : "revolute",
          parent < 0 ? "(the world)" : skeleton.joints[parent].name);
    if (const auto axis = drive_of(skeleton, *joint)) chain.push_back(*axis);
    parent = *joint;
  }
  return chain;
}

/// The coordinate axis (0 x, 1 y, 2 z) of a joint.
int coordinate_axis(const Joint& joint) {
  Eigen::Index axis = 0;
  const double length = joint.axis.norm();
  const double largest = joint.axis.cwiseAbs().maxCoeff(&axis);
  if (!(length > 0.0) || largest < (1.0 - 1e-9) * length)
    fail("the axis ({}, {}, {}) of the root joint '{}' is not one of the coordinate axes", joint.axis.x(),
         joint.axis.y(), joint.axis.z(), joint.name);
  return static_cast<int>(axis);
}

}  // namespace

std::optional<int> Skeleton::find_joint(const std::string& name) const { return find_by_name(joints, name); }

std::optional<int> Skeleton::find_dof(const std::string& name) const { return find_by_name(dofs, name); }

int Skeleton::joint_of_bone(const std::string& bone, BoneRule rule) const {
  for (int row = num_joints() - 1; row >= 0; --row) {
    const int joint = file_order.empty() ? row : file_order[row];
    if (carries(joints[joint].name, bone, rule)) return joint;
  }
  fail("no joint of the skeleton carries the bone '{}': none {} '{}'", bone,
       rule == BoneRule::exact ? "has this name up to its first '_', as in" : "has a name that begins with",
       rule == BoneRule::exact ? bone + "_rx" : bone);
}

std::vector<Eigen::Affine3d> Skeleton::pose(const std::vector<double>& dof_values) const {
  if (static_cast<int>(dof_values.size()) != num_dofs())
    fail("a pose of this skeleton has {} DoFs, received {}", num_dofs(), dof_values.size());
  std::vector<double> q(joints.size(), 0.0);
  for (int d = 0; d < num_dofs(); ++d)
    for (const Dof::Drive& drive : dofs[d].joints) q[drive.joint] += drive.weight * dof_values[d];

  std::vector<Eigen::Affine3d> world_from_joint(joints.size());
  for (int j = 0; j < num_joints(); ++j) {
    const Joint& joint = joints[j];
    const Eigen::Affine3d parent_from_joint = Eigen::Translation3d(joint.offset) * joint_motion(joint, q[j]);
    world_from_joint[j] = joint.parent < 0 ? parent_from_joint : world_from_joint[joint.parent] * parent_from_joint;
  }
  return world_from_joint;
}

Skeleton::Root Skeleton::root() const {
  const std::vector<RootAxis> chain = root_chain(*this);
  Root root;
  std::array<bool, 3> moved{}, turned{};
  for (int i = 0; i < 3; ++i) {
    const RootAxis& along = chain[i];
    const int axis = coordinate_axis(joints[along.joint]);
    if (std::exchange(moved[axis], true))
      fail("two translations of the root move along the same axis as '{}'", joints[along.joint].name);
    root.translation[axis] = along.dof;
    root.translation_weight[axis] = along.weight * joints[along.joint].axis[axis];

    const RootAxis& about = chain[3 + i];
    root.axes[i] = coordinate_axis(joints[about.joint]);
    if (std::exchange(turned[root.axes[i]], true))
      fail("two rotations of the root turn about the same axis as '{}'", joints[about.joint].name);
    root.rotation[i] = about.dof;
    root.rotation_weight[i] = about.weight * joints[about.joint].axis[root.axes[i]];
  }
  return root;
}

Eigen::Vector3d marker_to_file(const Skeleton& skeleton, const Marker& marker, MarkerReading reading) {
  if (reading == MarkerReading::joint_relative) return marker.position;
  const std::vector<double> zero(skeleton.dofs.size(), 0.0);
  return skeleton.pose(zero)[marker.joint] * marker.position;
}

void reread_markers(Skeleton& skeleton, MarkerReading reading) {
  if (reading == skeleton.marker_reading) return;
  const auto world_from_joint = skeleton.pose(std::vector<double>(skeleton.dofs.size(), 0.0));
  for (Marker& marker : skeleton.markers) {
    const Eigen::Affine3d& transform = world_from_joint[marker.joint];
    marker.position = reading == MarkerReading::zero_pose_world ? transform.inverse(Eigen::Isometry) * marker.position
                                                                : transform * marker.position;
  }
  skeleton.marker_reading = reading;
}

}  // namespace doppel
