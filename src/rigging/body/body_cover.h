#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/rigging/body/body_warp.h"

namespace doppel {

/// Hair and loose clothes as displacements of the surface: a vertex moves along its direction by a share of the hair's
/// volume, of the looseness of the top, and of the looseness of the trousers.
struct BodyCover {
  std::vector<Eigen::Vector3d> outward;     ///< [N] unit, smooth over the surface
  std::vector<double> hair, top, trousers;  ///< [N] shares, 0..1, smooth over the surface
};

/// The cover of a mesh in the rest pose.
/// @param weights [N] @param joints completed
BodyCover make_body_cover(const TriangleMesh& mesh, const std::vector<SegmentWeights>& weights,
                          const BodyJoints& joints);

}  // namespace doppel
