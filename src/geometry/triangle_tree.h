#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/geometry/triangle_tree_kernel.h"

namespace doppel {

/// The point of a triangle that is nearest to another point.
struct TrianglePoint {
  double squared_distance = std::numeric_limits<double>::infinity();
  /// Barycentric coordinates, >= 0, sum 1. A corner that the point does not depend on has exactly 0: one zero on an
  /// edge, two in a corner.
  std::array<double, 3> weights{};
};

/// The point of a triangle nearest to `point`. @param corners may be degenerate: a line or a point
TrianglePoint closest_on_triangle(const Eigen::Vector3d& point, const std::array<Eigen::Vector3d, 3>& corners);

/// A hierarchy of bounding boxes around the triangles of a mesh, built once and refitted when the vertices move. A
/// kernel compares eight boxes or triangles at once. The closest points are exact: those of closest_on_triangle, bit
/// for bit.
class TriangleTree {
 public:
  struct Hit : TrianglePoint {
    int face = -1;  ///< the lowest index among faces at the same distance
  };

  /// @param vertices in any unit; their positions decide which triangles share a box
  /// @throws UsageError when there are no faces, an index exceeds the vertices, or a vertex is not finite
  TriangleTree(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& faces);

  /// Fits the boxes to moved vertices. The assignment of triangles to boxes stays as built. About 0.2 ms for 11,000
  /// faces.
  /// @throws UsageError for another number of vertices, or a vertex that is not finite
  void refit(const std::vector<Eigen::Vector3d>& vertices);

  /// @param point finite
  /// @param near_face a face assumed to be close, which shortens the search, or -1; the result is the same bit for bit
  Hit closest(const Eigen::Vector3d& point, int near_face = -1) const;

  int num_vertices() const { return num_vertices_; }
  int num_faces() const { return static_cast<int>(faces_.size()); }

 private:
  struct Range {
    int first, count;
  };
  int add_node(std::vector<int>& order, Range range, const std::vector<Eigen::Vector3d>& centres);
  int add_leaf(const std::vector<int>& order, Range range);
  void try_triangle(const Eigen::Vector3d& point, const TreeLeaf& leaf, int lane, Hit& best) const;

  int num_vertices_;
  std::vector<Triangle> faces_;  ///< [F] in the mesh's order
  std::vector<int> slot_;        ///< [F] leaf * kTreeWidth + lane of each face
  std::vector<TreeNode> nodes_;  ///< the root first, children after their parents
  std::vector<TreeLeaf> leaves_;
  double margin_ = 0.0;  ///< of squared distances, above their rounding errors
};

}  // namespace doppel
