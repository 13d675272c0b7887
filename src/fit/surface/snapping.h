#pragma once

#include <vector>

#include "doppel/geometry/topology.h"
#include "doppel/fit/surface/outline_term.h"

namespace doppel {

struct SnapOptions {
  double farthest = 20.0;  ///< pixels of the thesis's image (540 wide) that a vertex may be moved
  double softest = 3.0;    ///< rigidity of cloth: vertices that are stiffer never move
  int rings = 4;           ///< of neighbours around snapped vertices that move along
  int sweeps = 25;         ///< over these neighbours
  double newcomer = 0.7;   ///< share of the way that a vertex moves which was not on the outline in the last frame
};

/// Puts outline vertices onto the mask's outline in one go (4.6.6), when a surface is already close to it: each walks
/// along the jacobian of the distance until it lies as it should, and keeps its depth. Vertices that face another outline,
/// would leave their part of the body or have too far to go stay. Their neighbours follow by a Laplacian warp.
/// @param vertices [3,N] moved in place @param rigidity [N] of the materials (Table 4.1)
/// @param was_outline [N] 1 for vertices that were on the outline in the last frame; empty: no frame before
/// @return how many were snapped
int snap_outline(Eigen::Matrix3Xd& vertices, const OutlineTerm::Evidence& evidence,
                 const std::vector<OutlineVertex>& outline, const MeshTopology& topology,
                 const std::vector<double>& rigidity, const std::vector<char>& was_outline,
                 const SnapOptions& options = {});

/// Shortens the motion of vertices that move `factor` times as far as their neighbours do on average, to that average:
/// what moves alone is a mistake. @param before [3,N] the last frame's @return how many were held back
int clamp_isolated_motion(Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xd& before, const MeshTopology& topology,
                        double factor);

}  // namespace doppel
