#pragma once

#include <torch/types.h>

#include "doppel/geometry/triangle_tree.h"

namespace doppel {

/// Distances from points to a triangle mesh, exact up to rounding. The mesh need not be closed.
class SurfaceDistance {
 public:
  /// @param vertices float32 [N,3] @param faces int32 [F,3]
  /// @throws UsageError for another shape or type, no faces, an index beyond the vertices, or a vertex not finite
  SurfaceDistance(const torch::Tensor& vertices, const torch::Tensor& faces);

  /// The distances of points float32 [M,3] to the nearest point of any triangle, in the unit of the vertices. @return
  /// float64 [M]
  torch::Tensor distances(const torch::Tensor& points) const;

 private:
  TriangleTree tree_;
};

/// The distance between two surfaces.
struct SurfaceGap {
  double hausdorff = 0.0;  ///< the largest distance of a vertex of either mesh to the other surface
  double mean = 0.0;       ///< mean distance of the vertices to the other surface, mean of both directions
  torch::Tensor from_a;    ///< float64 [N], distance of each vertex of the first mesh to the second surface
};

/// Compares two surfaces. Distances are exact, but they are computed at the vertices only; between vertices the
/// distance can be larger.
/// @param a float32 [N,3] @param a_faces int32 [F,3]; likewise `b`
/// @throws as SurfaceDistance
SurfaceGap surface_gap(const torch::Tensor& a, const torch::Tensor& a_faces, const torch::Tensor& b,
                       const torch::Tensor& b_faces);

}  // namespace doppel
