#pragma once

#include <span>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Rows of integers in one array: row i is items[offsets[i] .. offsets[i+1]).
struct IndexRows {
  std::vector<int> offsets{0};  ///< [rows + 1]
  std::vector<int> items;

  int num_rows() const { return static_cast<int>(offsets.size()) - 1; }
  std::span<const int> row(int row) const { return row_of(items, row); }
  /// The values of a row, one for each item. @param values [items.size()]
  template <typename T>
  std::span<const T> row_of(const std::vector<T>& values, int row) const {
    return {values.data() + offsets[row], values.data() + offsets[row + 1]};
  }
  int size(int row) const { return offsets[row + 1] - offsets[row]; }
};

/// The neighbours of each vertex of a mesh, or of any graph given by `edges`.
class MeshTopology {
 public:
  explicit MeshTopology(const TriangleMesh& mesh);
  MeshTopology(int num_vertices, const std::vector<std::array<int, 2>>& edges);

  int num_vertices() const { return one_ring_.num_rows(); }
  /// [N] neighbours over one edge, ascending.
  const IndexRows& one_ring() const { return one_ring_; }
  /// Undirected edges {a,b}, a < b, sorted.
  const std::vector<std::array<int, 2>>& edges() const { return edges_; }
  /// Connected component of each vertex [N], numbered by its smallest vertex.
  std::vector<int> components() const;

  /// Hop distances from `source`, ascending by (hops, vertex). Vertices farther than `max_hops` are not listed. The
  /// cost is proportional to the number of listed vertices.
  std::vector<std::pair<int, int>> ball(int source, int max_hops) const;  ///< (vertex, hops)
  /// Shortest path lengths along edges (Dijkstra) up to `max_length`: (vertex, length), ascending by length.
  std::vector<std::pair<int, double>> geodesic_ball(int source, double max_length,
                                                    const std::vector<Eigen::Vector3d>& positions) const;

 private:
  void build_rows(int num_vertices);
  IndexRows one_ring_;
  std::vector<std::array<int, 2>> edges_;
};

/// The faces that share an edge with each face [F], ascending. Any number of faces may share an edge, in any winding;
/// an edge whose two ends are the same vertex counts for nothing.
IndexRows face_neighbours(const std::vector<Triangle>& faces);

/// Counts and properties of a mesh, for `doppel info` and for checks.
struct MeshReport {
  int boundary_edges = 0, non_manifold_edges = 0, components = 0, degenerate_faces = 0, isolated_vertices = 0;
  int euler_characteristic = 0;  ///< V - E + F
  bool closed() const { return boundary_edges == 0 && non_manifold_edges == 0; }
};
MeshReport inspect_mesh(const TriangleMesh& mesh);

/// Quadric edge collapse (OpenMesh) down to about `target_vertices`. The remaining vertices keep their positions.
/// Vertex colours and UVs are dropped. @throws Error when the target cannot be reached within 5 %
TriangleMesh decimate(const TriangleMesh& mesh, int target_vertices);

}  // namespace doppel
