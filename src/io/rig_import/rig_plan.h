#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "doppel/io/scene/scene.h"

namespace doppel {

/// Which nodes of a scene become joints, and how they and the surface stood when the surface was bound.
struct RigPlan {
  std::vector<int> nodes;                        ///< [J] parents first; joint 0 is the root
  std::vector<int> parents;                      ///< [J] joint, -1 for the root
  std::vector<Eigen::Affine3d> bind;             ///< [J] world from joint in the bind pose, scene coordinates
  std::vector<Eigen::Affine3d> scene_from_skin;  ///< [skins] moves the vertices of a skin to the bind pose
  std::vector<int> part_joint;                   ///< [primitives] joint that carries what has no weights, or -1
  std::vector<Eigen::Affine3d> scene_from_part;  ///< [primitives] moves that to the bind pose
  std::vector<std::string> warnings;

  int num_joints() const { return static_cast<int>(nodes.size()); }
  int joint_of_node(int node) const;  ///< -1: none
};

/// The joints of all skins in use, the nodes between them, and nodes that carry parts without a skin and move by
/// themselves. If that leaves several roots, the node above all of them is the root.
///
/// The bind pose is the one in which most joints of a skin agree that the surface keeps its shape and, first, its
/// directions; where a file names it, that one.
/// @throws Error when no surface has a skin, or a joint is mirrored or sheared against its bind pose
RigPlan plan_rig(const Scene& scene);

/// The rotation and the position that a joint's motion takes the bind pose to; scale and shear are dropped.
/// @param centre the joint in the bind pose
struct JointPose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};
JointPose joint_pose(const Eigen::Affine3d& motion, const Eigen::Vector3d& centre);

}  // namespace doppel
