#pragma once

#include <vector>

#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// The skinned surface of a pose, computed once for several users.
struct PosedSurface {
  Eigen::Matrix3Xd vertices;             ///< [3,N] world metres
  std::vector<Eigen::Vector3d> normals;  ///< [N] unit; the template's, rotated
  std::vector<Eigen::Matrix3d> turns;    ///< [N] world from rest: the rotation of each vertex by skinning
};
/// @param rest [N] the surface in the rest pose: the template's vertices, possibly deformed
PosedSurface pose_surface(const PoseModel& model, const PosedBody& body, const std::vector<Eigen::Vector3d>& rest);

}  // namespace doppel
