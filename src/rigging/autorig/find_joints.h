#pragma once

#include <string>
#include <vector>

#include "doppel/rigging/autorig/body_points.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

struct FoundJoints {
  BodyJoints joints;                ///< metres, in the mesh's frame; complete (complete_joints)
  BodyPoints points;                ///< what they come from
  std::vector<std::string> doubts;  ///< sentences for the user, e.g. of arms that touch the trunk
};

/// Finds the joints of a scan of one standing person: BlazePose in images from cameras around the scan, landmarks in
/// space, joints.
/// @param mesh metres, y up
/// @throws Error in a sentence that says how to mend it: no person in the images, two persons, no legs (a bust), a
///   person who sits, or lengths of bones that no body has
FoundJoints find_joints(const TriangleMesh& mesh, const BodyPointsOptions& options = {});

/// What is wrong with the pose of a body, which prevents a rig; empty: nothing.
std::string pose_fault(const BodyJoints& joints);

/// The scan from eight sides as one sheet, with joints and bones drawn on it. 8-bit BGR.
/// @param mesh metres, in the frame of the joints
cv::Mat draw_joint_sheet(const TriangleMesh& mesh, const BodyJoints& joints);

}  // namespace doppel
