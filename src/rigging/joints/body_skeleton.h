#pragma once

#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/geometry/mesh.h"
#include "doppel/rigging/joints/body_joints.h"
#include "doppel/rigging/weights/heat_weights.h"

namespace doppel {

/// A skeleton and the pose of the body that it was made from.
struct BodySkeleton {
  Skeleton skeleton;
  std::vector<double> rest_dofs;  ///< [D]
};

/// Our skeleton with the bone lengths of a body. With all DoFs 0 the body stands straight and looks along +z, the arms
/// point to the sides with the palms down, the feet point forwards. A DoF therefore means the same motion for every
/// body; `rest_dofs` says how the body stood in the scan. What the DoFs cannot express (a carrying angle of the elbow)
/// stays in the offsets, so that in the rest pose every joint lies exactly where it was given.
///
/// Joints and DoFs: Root (tx ty tz ry rz rx); Spine (rx rz ry, shared with Chest); Head (ry rz rx, shared with Neck);
/// LeftShoulder (ry rz: the clavicle), LeftArm (rz ry rx), LeftForeArm (ry: flexion), LeftForeArmRoll (rx: twist),
/// LeftHand (rz ry), LeftUpLeg (rx rz ry), LeftLeg (rx), LeftFoot (rx rz), LeftToeBase (rx), and the same on the right.
/// A hand whose finger points are known also has LeftHandThumb1 (ry rz), LeftHandThumb2 (rx), LeftHandThumb3 (rx), and
/// for Index, Middle, Ring and Pinky LeftHandIndex1 (ry: towards the thumb, rz: flexion), LeftHandIndex2 (rz, of which
/// LeftHandIndex3 turns by 0.67): anatomical couplings and limits.
/// A positive angle means the same on both sides: forwards, outwards or upwards, flexion. Limits are those of healthy
/// adults, widened where the rest pose lies outside.
/// @throws Error when a limb joint is missing (see complete_joints) or two neighbours coincide
BodySkeleton make_body_skeleton(BodyJoints joints);

/// The bones of that skeleton as sources of heat, in the rest pose.
std::vector<HeatBone> heat_bones(BodyJoints joints);

/// Adds a marker for each point of each built-in keypoint layout: joints of the body, eyes, ears, nose, heels and toes
/// on the surface, the 68 points of a face by the proportions of the head, the joints of the fingers by those of the
/// hand.
/// @param mesh in the rest pose
void add_body_markers(BodySkeleton& body, const BodyJoints& joints, const TriangleMesh& mesh);

/// LIP labels by region [N]: hair, face, upper clothes, arms, pants, shoes, from the bone that moves a vertex most and
/// its position along the bone. Clothes are not told from skin: trunk and upper arms count as upper clothes, legs as
/// pants, forearms, hands, neck and face as skin, feet as shoes.
std::vector<int> region_labels(const TriangleMesh& mesh, const SkinningWeights& skin, const BodyJoints& joints);

}  // namespace doppel
