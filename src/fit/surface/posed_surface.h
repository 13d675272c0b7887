#pragma once

#include <vector>

#include "doppel/energy/pose_model.h"

namespace doppel {

/// The skinned surface of a pose, worked out once for all who ask.
struct PosedSurface {
  Eigen::Matrix3Xd vertices;             ///< [3,N] world metres
  std::vector<Eigen::Vector3d> normals;  ///< [N] unit; of the template, turned
  std::vector<Eigen::Matrix3d> turns;    ///< [N] world from rest: how skinning turns each vertex
};
/// @param rest [N] the surface in the rest pose: the template's vertices, or these bent
PosedSurface pose_surface(const PoseModel& model, const PosedBody& body, const std::vector<Eigen::Vector3d>& rest);

}  // namespace doppel
