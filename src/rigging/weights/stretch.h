#pragma once

#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// What a triangle may stretch in an extreme pose, unless its neighbours stretch as well.
inline constexpr double kStretchLimit = 3.0;

/// How much each triangle is stretched by a motion of its corners [F]: the larger singular value of its deformation
/// gradient, the linear map of its plane. 1 for a rigid motion. A triangle that is nearly a line at rest (its height is
/// below 1 % of its longest edge) has no reliable gradient; it counts with the factor of its longest edge. A triangle
/// without extent counts 1.
/// @param rest, posed [N]
std::vector<double> triangle_stretches(const std::vector<Triangle>& faces, const std::vector<Eigen::Vector3d>& rest,
                                       const std::vector<Eigen::Vector3d>& posed);

struct StretchedTriangles {
  int all = 0;           ///< triangles that stretch more than the limit
  int alone = 0;         ///< those of them for which stretches_alone holds
  double largest = 0.0;  ///< stretch of any triangle
};

/// Whether a triangle stretches more than the limit and has a neighbour that stretches less than half as much, or no
/// neighbours at all.
/// @param stretches [F] @param neighbours [F] face_neighbours
bool stretches_alone(const std::vector<double>& stretches, const IndexRows& neighbours, int face, double limit);

/// Counts the triangles that stretch too much. A joint stretches a whole region of skin, in which neighbours differ
/// little. A vertex that moves wrongly stretches the triangles around itself and not those beyond: they stretch alone.
/// @param neighbours [F] face_neighbours
StretchedTriangles count_stretched(const std::vector<double>& stretches, const IndexRows& neighbours, double limit);

}  // namespace doppel
