#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace doppel {

/// Distances from points to a triangle mesh, exact up to rounding, by a tree of boxes.
class SurfaceDistance {
 public:
  /// @param vertices float32 [N,3] @param faces int32 [F,3]
  /// @throws UsageError for another shape or type, no faces, or an index beyond the vertices
  SurfaceDistance(const torch::Tensor& vertices, const torch::Tensor& faces);

  /// From a point to the nearest point of any triangle, in the vertices' unit.
  double operator()(const Eigen::Vector3d& point) const;
  /// The same for points float32 [M,3]: float64 [M].
  torch::Tensor distances(const torch::Tensor& points) const;

 private:
  struct Box {
    Eigen::Vector3d low, high;
    double squared_distance(const Eigen::Vector3d& point) const;
  };
  /// A leaf holds triangles first .. first+count; an inner node (count 0) its children at first and first+1.
  struct Node {
    Box box;
    int first = 0, count = 0;
  };
  void build(int node, int first, int count, std::vector<int>& order);

  std::vector<std::array<Eigen::Vector3d, 3>> triangles_;  ///< in the order of the leaves
  std::vector<Node> nodes_;
};

/// The squared distance from a point to a triangle, which may be degenerate.
double squared_distance_to_triangle(const Eigen::Vector3d& point, const std::array<Eigen::Vector3d, 3>& triangle);

/// How far two surfaces are apart.
struct SurfaceGap {
  double hausdorff = 0.0;  ///< the largest distance of a vertex of either mesh to the other surface
  double mean = 0.0;       ///< mean distance of a vertex to the other surface, mean of both directions
};

/// Distances are exact, but taken at the vertices; between them a surface may be farther by what a face bulges out.
/// @param a float32 [N,3] @param a_faces int32 [F,3]; likewise b
/// @throws as SurfaceDistance
SurfaceGap surface_gap(const torch::Tensor& a, const torch::Tensor& a_faces, const torch::Tensor& b,
                       const torch::Tensor& b_faces);

}  // namespace doppel
