#pragma once

#include "doppel/geometry/triangle_tree.h"

namespace doppel {

/// The face beyond each edge of a closed surface: row f, entry k for the edge from corner k to corner k+1 of face f.
/// @throws Error when an edge belongs to one face only, to more than two faces, or to two faces of opposite winding.
///   The message counts such edges and names the first ones by their vertices.
std::vector<Triangle> faces_across_edges(const std::vector<Triangle>& faces);

/// Signed distances from a moving closed triangle mesh.
///
/// The normal at the closest point decides the sign. On a face it is the face normal, on an edge the sum of the normals
/// of both faces, in a vertex the sum of the normals of its faces weighted by their angles there (Baerentzen & Aanaes
/// 2005). The sign is correct for every point off a surface without self-intersections.
class ClosedSurface {
 public:
  struct Hit {
    double distance = 0.0;  ///< negative inside
    int face = -1;
    std::array<double, 3> weights{};  ///< barycentric, as in TrianglePoint
    /// Unit vector of the direction in which the distance grows. On the surface it is the normal. It is 0 only where
    /// degenerate faces leave the normal undefined.
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
