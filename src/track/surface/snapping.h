#pragma once

#include <vector>

#include "doppel/geometry/topology.h"
#include "doppel/track/fit/thesis_units.h"
#include "doppel/track/surface/outline_term.h"

namespace doppel {

struct SnapOptions {
  double farthest = thesis_pixels(20.0);  ///< largest motion of a vertex, reference pixels
  double max_rigidity = 3.0;              ///< largest rigidity of a vertex that may move (thesis: any may move)
  int rings = 4;                          ///< rings of neighbours around snapped vertices that follow
  int sweeps = 25;                        ///< iterations over these neighbours
  /// Share of the motion for a vertex that was not on the outline in the last frame (thesis: 1).
  double first_share = 0.7;
};

/// Moves the outline vertices of a nearly fitted surface onto the mask's outline (4.6.6). Each follows the gradient of
/// the distance field to its target distance and keeps its depth. A vertex stays if it faces another outline, would
/// leave its part of the body, or would move too far. The neighbours of moved vertices follow by a Laplacian warp.
/// @param vertices [3,N] moved in place @param rigidity [N] of the materials (Table 4.1)
/// @param was_outline [N] 1 for vertices that were on the outline in the last frame; empty: no frame before
/// @return how many were snapped
int snap_outline(Eigen::Matrix3Xd& vertices, const OutlineTerm::Evidence& evidence,
                 const std::vector<OutlineVertex>& outline, const MeshTopology& topology,
                 const std::vector<double>& rigidity, const std::vector<char>& was_outline,
                 const SnapOptions& options = {});

/// Clamps isolated motion, which is usually an error: a vertex that moves more than `factor` times the mean motion of
/// its neighbours is moved by that mean only.
/// @param before [3,N] vertices of the last frame @return the number of clamped vertices
int clamp_isolated_motion(Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xd& before, const MeshTopology& topology,
                          double factor);

}  // namespace doppel
