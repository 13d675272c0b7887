#include "doppel/io/rig_import/rig_motion.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"

namespace doppel {

namespace {

constexpr double kMetresPerTranslationUnit = 0.001;  // DoFs of translations are millimetres, as in Skeletool files
/// A joint that leaves its position in its parent by more than this has DoFs for it, metres.
constexpr double kStillTranslation = 2e-6;

/// Of one animation: more than two hours at 60 per second. A damaged time of a key asks for any number.
constexpr long kMaxFrames = 500'000;

/// The axis about which the joint's bone twists: the one nearest to the direction of its children.
int twist_axis(const RigPlan& plan, const std::vector<Eigen::Vector3d>& centres, int joint) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int j = 0; j < plan.num_joints(); ++j)
    if (plan.parents[j] == joint) sum += centres[j] - centres[joint];
  if (sum.norm() < 1e-9 && plan.parents[joint] >= 0) sum = centres[joint] - centres[plan.parents[joint]];
  Eigen::Index axis = 1;
  if (sum.norm() > 1e-9) sum.cwiseAbs().maxCoeff(&axis);
  return static_cast<int>(axis);
}

/// Bending first, twist last. The root turns about the vertical first, so that its heading is one DoF.
EulerOrder preferred_order(const RigPlan& plan, const std::vector<Eigen::Vector3d>& centres, int joint) {
  if (plan.parents[joint] < 0) return {1, 2, 0};
  switch (twist_axis(plan, centres, joint)) {
    case 0:
      return {1, 2, 0};
    case 1:
      return {0, 2, 1};
    default:
      return {0, 1, 2};
  }
}

/// Adds one axis of motion below `parent` and its DoF. @return its index, which is also that of the new parent
int add_axis(Skeleton& skeleton, const std::string& name, int parent, const Eigen::Vector3d& offset, Joint::Type type,
             int axis, std::optional<std::array<double, 2>> limits) {
  const double length = type == Joint::Type::prismatic ? kMetresPerTranslationUnit : 1.0;
  skeleton.joints.push_back({name, type, parent, offset, length * Eigen::Vector3d::Unit(axis)});
  const int joint = skeleton.num_joints() - 1;
  skeleton.dofs.push_back({name, {{joint, 1.0}}, limits});
  return joint;
}

/// Which translations of a joint leave its position in any sample.
std::array<bool, 3> moving_axes(const RigPlan& plan, const std::vector<Eigen::Vector3d>& centres,
                                const std::vector<SampledAnimation>& samples, int joint) {
  Eigen::Vector3d largest = Eigen::Vector3d::Zero();
  for (const SampledAnimation& animation : samples)
    for (const auto& frame : animation.frames)
      largest = largest.cwiseMax(local_pose(plan, centres, frame, joint).translation.cwiseAbs());
  const bool root = plan.parents[joint] < 0;
  return {root || largest.x() > kStillTranslation, root || largest.y() > kStillTranslation,
          root || largest.z() > kStillTranslation};
}

}  // namespace

LocalPose local_pose(const RigPlan& plan, const std::vector<Eigen::Vector3d>& centres,
                     const std::vector<JointPose>& frame, int joint) {
  const JointPose& own = frame[joint];
  const int parent = plan.parents[joint];
  if (parent < 0) return {own.rotation, own.position - centres[joint]};
  const JointPose& above = frame[parent];
  const Eigen::Quaterniond back = above.rotation.conjugate();
  return {back * own.rotation, back * (own.position - above.position) - (centres[joint] - centres[parent])};
}

const SceneAnimation& find_animation(const Scene& scene, const std::string& name) {
  std::string names;
  for (const SceneAnimation& animation : scene.animations) {
    if (animation.name == name) return animation;
    names += (names.empty() ? "'" : ", '") + animation.name + "'";
  }
  fail<UsageError>("the file has no animation '{}'; it has {}", name, names.empty() ? "none" : excerpt(names, 500));
}

SampledAnimation sample_animation(const Scene& scene, const SceneAnimation& animation, const RigPlan& plan,
                                  const Eigen::Affine3d& character_from_scene, double frames_per_second) {
  SampledAnimation result;
  result.frames_per_second = frames_per_second;
  // Most animations begin near 0 on the file's time axis and stay on it; a late take begins with its first key.
  result.start = animation.start < 1.0 && animation.start >= 0.0 ? 0.0 : animation.start;
  const double duration = animation.end - result.start;
  const double count = std::floor(duration * frames_per_second + 1e-3) + 1;
  if (!(count >= 1 && count <= kMaxFrames))
    fail(
        "animation '{}' lasts from {:.4g} s to {:.4g} s, which is {:.4g} frames at {:.4g} per second; at most {} are "
        "sampled. Correct the times of its keys, or give a lower rate (--fps)",
        animation.name, result.start, animation.end, count, frames_per_second, kMaxFrames);
  const auto frames = static_cast<long>(count);
  const Eigen::Affine3d back = character_from_scene.inverse();
  std::vector<Eigen::Affine3d> character_from_bind;
  for (const Eigen::Affine3d& bind : plan.bind) character_from_bind.push_back(bind.inverse() * back);
  for (long f = 0; f < frames; ++f) {
    const auto world = node_transforms(scene, animation, result.start + static_cast<double>(f) / frames_per_second);
    std::vector<JointPose>& frame = result.frames.emplace_back();
    for (std::size_t j = 0; j < plan.nodes.size(); ++j) {
      const Eigen::Affine3d motion = character_from_scene * world[plan.nodes[j]] * character_from_bind[j];
      frame.push_back(joint_pose(motion, character_from_scene * plan.bind[j].translation()));
    }
  }
  return result;
}

RigSkeleton build_skeleton(const RigPlan& plan, const std::vector<std::string>& bones,
                           const std::vector<Eigen::Vector3d>& centres, const std::vector<SampledAnimation>& samples,
                           std::optional<double> joint_limit) {
  static constexpr char kAxisName[] = "xyz";
  RigSkeleton rig;
  std::vector<int> last;  // the innermost axis of each joint
  for (int j = 0; j < plan.num_joints(); ++j) {
    const int above = plan.parents[j];
    int parent = above < 0 ? -1 : last[above];
    Eigen::Vector3d offset = centres[j];
    if (above >= 0) offset -= centres[above];
    std::optional<std::array<double, 2>> limits;
    if (above >= 0 && joint_limit) limits = {-*joint_limit, *joint_limit};
    JointDofs dofs;
    const std::array<bool, 3> moving = moving_axes(plan, centres, samples, j);
    const auto add = [&](char kind, int axis, Joint::Type type, std::optional<std::array<double, 2>> range) {
      const std::string name = fmt::format("{}_{}{}", bones[j], kind, kAxisName[axis]);
      parent = add_axis(rig.skeleton, name, parent, offset, type, axis, range);
      offset.setZero();
      return rig.skeleton.num_dofs() - 1;
    };
    for (int axis = 0; axis < 3; ++axis)
      if (moving[axis]) dofs.translation[axis] = add('t', axis, Joint::Type::prismatic, std::nullopt);
    std::vector<Eigen::Quaterniond> rotations;
    for (const SampledAnimation& animation : samples)
      for (const auto& frame : animation.frames) rotations.push_back(local_pose(plan, centres, frame, j).rotation);
    dofs.order = preferred_order(plan, centres, j);
    if (above >= 0) dofs.order = choose_euler_order(rotations, dofs.order);
    for (std::size_t i = 0; i < 3; ++i) dofs.rotation[i] = add('r', dofs.order[i], Joint::Type::revolute, limits);
    rig.dofs.push_back(dofs);
    last.push_back(parent);
  }
  return rig;
}

Motion motion_of_samples(const RigPlan& plan, const RigSkeleton& rig, const std::vector<Eigen::Vector3d>& centres,
                         const SampledAnimation& samples, std::optional<double> joint_limit) {
  Motion motion;
  std::vector<Eigen::Vector3d> before(plan.nodes.size(), Eigen::Vector3d::Zero());
  for (const auto& frame : samples.frames) {
    std::vector<double> row(rig.skeleton.num_dofs(), 0.0);
    for (int j = 0; j < plan.num_joints(); ++j) {
      const JointDofs& dofs = rig.dofs[j];
      const LocalPose pose = local_pose(plan, centres, frame, j);
      Eigen::Vector3d& angles = before[j];
      angles = euler_angles(pose.rotation.toRotationMatrix(), dofs.order, angles);
      const bool within = plan.parents[j] >= 0 && joint_limit;
      for (int i = 0; i < 3; ++i) {
        double angle = angles[i];
        if (within && std::abs(angle) > *joint_limit) angle -= 2 * M_PI * std::round(angle / (2 * M_PI));
        row[dofs.rotation[i]] = angle;
        if (dofs.translation[i] >= 0) row[dofs.translation[i]] = pose.translation[i] / kMetresPerTranslationUnit;
      }
    }
    motion.frames.push_back(std::move(row));
    motion.ids.push_back(static_cast<long>(motion.ids.size()));
  }
  return motion;
}

}  // namespace doppel
