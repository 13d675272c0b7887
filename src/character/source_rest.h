#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "doppel/character/mapped_joints.h"

namespace doppel {

/// Whether the rest pose of a motion's skeleton is a pose of a body. In some files it is none: LAFAN1 and others lay
/// the bones along the x axes of their joints, so that the legs point where the trunk points. The rest pose is a pose
/// unless the limbs (hip to toe, collar to hand, neck to head) point on average more than 60 degrees away from those of
/// the character, after the rotation that aligns the bones at the root. A T-pose lies below 40 degrees from lowered
/// arms, a seat below 50.
/// A map with `rest_rotation` corrects the rest pose itself, and with fewer than three limbs nothing can be said: both
/// count as a pose.
/// @param target_rest [joints of the character] world from joint
/// @param source_rest [joints of the source] world from joint
bool is_pose_of_body(const std::vector<MappedJoint>& joints, const std::vector<Eigen::Affine3d>& target_rest,
                     const std::vector<Eigen::Affine3d>& source_rest);

/// A rest pose for a source whose own is no pose: its bones point as those of the character at rest, with their mean
/// lengths in the motion.
///
/// Joints with bones in several directions (pelvis, chest) are turned by all of them. A single bone leaves its twist
/// open, and an end (hand, head, toe) its whole rotation. These are as in the file's rest pose relative to the joint
/// above, if the motion is near to that on average (20 degrees), else such that their mean over the motion is no twist.
/// @return [joints of the source] world from joint; joints that are not mapped keep those of the file
std::vector<Eigen::Affine3d> rest_from_motion(const std::vector<MappedJoint>& joints,
                                              const std::vector<Eigen::Affine3d>& target_rest,
                                              const JointTracks& source);

}  // namespace doppel
