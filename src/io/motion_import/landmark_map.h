#pragma once

#include "doppel/character/joint_map.h"
#include "doppel/character/joint_tracks.h"

namespace doppel {

/// Pairs the joints of a character with those of a motion by the landmarks of both bodies (find_landmarks): pelvis,
/// spine, chest, neck, head and the joints of the limbs. Names decide, and the shape of the tree where they say too
/// little. A wrist or a toe that no name shows is the only joint below the elbow or the ankle. Below the pelvis,
/// further joints of both bodies with the same name (fingers) are paired too. The root of the map is the pelvis, or
/// the nearest joint above it that also carries the legs. Joints of the character that are not below this root, such as
/// feet that hang on the root of the rig, are left out.
/// @param rest_dofs [D] of the character
/// @throws UsageError when fewer than five joints are paired, or not both the pelvis and a leg; it lists the joints
JointMap landmark_joint_map(const Skeleton& skeleton, const std::vector<double>& rest_dofs, const JointTracks& source);

}  // namespace doppel
