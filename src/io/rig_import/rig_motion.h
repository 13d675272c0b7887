#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/io/rig_import/euler_order.h"
#include "doppel/io/rig_import/rig_plan.h"

namespace doppel {

/// Poses of all joints at the frames of one animation, in the character's world.
struct SampledAnimation {
  double start = 0.0, frames_per_second = 0.0;
  std::vector<std::vector<JointPose>> frames;  ///< [F][J]
};

/// The DoFs of one joint of the rig: which translations it has, the order of its rotations, and where they are in a row
/// of a motion.
struct JointDofs {
  std::array<int, 3> translation{-1, -1, -1};  ///< DoF along x, y, z, or -1; millimetres
  std::array<int, 3> rotation{-1, -1, -1};     ///< DoFs in `order`; radians
  EulerOrder order{1, 2, 0};
};

/// A joint's rotation and translation in its parent's frame, relative to the bind pose.
struct LocalPose {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};
/// @param centres [J] of the joints in the bind pose
LocalPose local_pose(const RigPlan& plan, const std::vector<Eigen::Vector3d>& centres,
                     const std::vector<JointPose>& frame, int joint);

/// The animation of a scene with this name. @throws UsageError that lists the names of all
const SceneAnimation& find_animation(const Scene& scene, const std::string& name);

/// Samples an animation of a scene.
/// @param character_from_scene rotation and uniform scale
/// @throws Error for more frames than hours of motion have, as a damaged time of a key asks for
SampledAnimation sample_animation(const Scene& scene, const SceneAnimation& animation, const RigPlan& plan,
                                  const Eigen::Affine3d& character_from_scene, double frames_per_second);

/// The skeleton of a rig, with the translations that the samples need, and the DoFs of each joint.
/// @param bones [J] names
struct RigSkeleton {
  Skeleton skeleton;
  std::vector<JointDofs> dofs;  ///< [J]
};
RigSkeleton build_skeleton(const RigPlan& plan, const std::vector<std::string>& bones,
                           const std::vector<Eigen::Vector3d>& centres, const std::vector<SampledAnimation>& samples,
                           std::optional<double> joint_limit);

/// The sampled poses as values of the DoFs.
Motion motion_of_samples(const RigPlan& plan, const RigSkeleton& rig, const std::vector<Eigen::Vector3d>& centres,
                         const SampledAnimation& samples, std::optional<double> joint_limit);

}  // namespace doppel
