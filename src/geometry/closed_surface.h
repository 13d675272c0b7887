#pragma once

#include "doppel/geometry/triangle_tree.h"

namespace doppel {

/// Which face lies beyond each edge of a closed surface: row f, entry k for the edge from corner k to corner k+1 of
/// face f.
/// @throws Error when an edge belongs to one face only, to more than two, or to two that are not wound alike. The
///   message counts such edges and names the first ones by their vertices.
std::vector<Triangle> faces_across_edges(const std::vector<Triangle>& faces);

/// A closed triangle mesh that moves: distances from it with a sign.
///
/// Inside is decided by the normal at the closest point: that of the face, on an edge the sum of both faces' normals,
/// in a vertex the sum of its faces' normals weighted by their angles there (Baerentzen & Aanaes 2005). That is right
/// for every point off a surface that does not cut itself.
class ClosedSurface {
 public:
  struct Hit {
    double distance = 0.0;  ///< negative inside
    int face = -1;
    std::array<double, 3> weights{};  ///< barycentric, as in TrianglePoint
    /// Unit vector in which the distance grows. On the surface the normal; 0 only where degenerate faces leave none.
    Eigen::Vector3d outward = Eigen::Vector3d::Zero();
  };

  /// @param faces counter-clockwise from outside
  /// @throws UsageError as TriangleTree. @throws Error as faces_across_edges when the mesh is not closed
  ClosedSurface(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& faces);

  /// @throws UsageError as TriangleTree::refit
  void move(const std::vector<Eigen::Vector3d>& vertices);

  /// @param point finite @param near_face as TriangleTree::closest
  Hit closest(const Eigen::Vector3d& point, int near_face = -1) const;

  int num_vertices() const { return tree_.num_vertices(); }
  const std::vector<Triangle>& faces() const { return faces_; }
  /// Row f: the face beyond the edge from corner k to corner k+1 of face f.
  const std::vector<Triangle>& across() const { return across_; }

 private:
  Eigen::Vector3d normal_at(int face, const std::array<double, 3>& weights) const;

  std::vector<Triangle> faces_, across_;
  TriangleTree tree_;
  std::vector<Eigen::Vector3d> vertices_, face_normals_, vertex_normals_;
};

}  // namespace doppel
