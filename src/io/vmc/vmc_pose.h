#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "doppel/io/figure_export/figure.h"

namespace doppel {

/// A bone as the VMC protocol sends it: Unity's axes (left-handed, x to the avatar's right, y up, z forward), metres.
struct VmcBone {
  std::string name;             ///< of Unity's HumanBodyBones, e.g. LeftUpperArm, LeftThumbProximal
  int parent = -1;              ///< index of another bone, always smaller; -1: the root
  Eigen::Vector3d position;     ///< from the parent bone, in its axes; of the hips: in the world
  Eigen::Quaterniond rotation;  ///< in the axes of the parent; identity in the T-pose
};

/// Poses of a character as poses of a humanoid avatar. Receivers know bones by name and expect that every bone has the
/// world's axes while the avatar stands in a T-pose and faces z. Our rest pose may be another: the bones of arms and
/// legs are first turned into the T-pose, by the smallest rotation of their direction. Hands go on in the direction of
/// the arms. Fingers are straightened along them; thumbs stay as they are beside the hand.
///
///   W_b = G_b R_b^-1 T_b^-1            G posed, R rest, T rest to T-pose: rotations in the world
///   local rotation = W_parent^-1 W_b,  then (x, y, z, w) -> (x, -y, -z, w) for Unity's axes
class VmcAvatar {
 public:
  /// @throws UsageError when the names of the skeleton do not show hips, head, arms and legs
  explicit VmcAvatar(const Character& character);
  /// @param dofs [D] @return parents first
  std::vector<VmcBone> bones(const std::vector<double>& dofs) const;

 private:
  struct Part {
    std::string name;
    int parent = -1, node = 0;
    Eigen::Matrix3d t_pose = Eigen::Matrix3d::Identity();  ///< T_b
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();      ///< from the parent in the T-pose, metres
  };
  void add_parts();
  void turn_to_t_pose();
  /// Turns a bone of a finger that goes on in the direction of the hand, so that the next bone lies along the arm.
  void straighten_finger(int bone);
  Eigen::Vector3d rest_position(int part) const;
  int part_named(const std::string& name) const;

  Skeleton skeleton_;
  Figure figure_;
  std::vector<Part> parts_;
  Eigen::Matrix3d facing_ = Eigen::Matrix3d::Identity();  ///< turns the rest pose to face z
};

}  // namespace doppel
