#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// The distance between a node and a vertex: edges on the template (`hops`, as in public checkpoints), or path length.
enum class GraphMetric { hops, geodesic };

/// How the weight of a node falls with the distance d from it, r being its radius.
/// - truncated: exp(-1/2 (d/r)^2) for d <= r, as in public checkpoints. The weight ends at .61 of its height, and the
///   surface has a small step there.
/// - smooth: (1 - (d / 1.5 r)^2)^2 for d <= 1.5 r, which ends at 0 with slope 0. The thesis states no function.
enum class GraphFalloff { truncated, smooth };

struct GraphOptions {
  GraphMetric metric = GraphMetric::hops;
  GraphFalloff falloff = GraphFalloff::truncated;
  int minimum_radius = 3;  ///< hops (times the mean edge length for `geodesic`)
  bool adaptive_radius =
      true;  ///< r_k = max(minimum, half of the farthest graph neighbour), in hops rounded down; false: minimum
};

/// K nodes on template vertices, their neighbours, and the weights w_ik of 6.2.
struct EmbeddedGraph {
  std::vector<int> node_vertex;           ///< [K] template vertex each node sits on; g_k is its rest position
  std::vector<std::array<int, 2>> edges;  ///< undirected {k,l}, k < l, sorted
  std::vector<double> radius;             ///< [K] hops, or metres for `geodesic`
  IndexRows vertex_nodes;                 ///< [N] rows of node indices, ascending
  std::vector<double> weights;            ///< aligned with vertex_nodes.items; each row sums to 1
  std::vector<Triangle> faces;            ///< of the coarse mesh whose edges these are, in node indices

  int num_nodes() const { return static_cast<int>(node_vertex.size()); }
};

/// Builds the graph from a coarse mesh of the template. Node k is vertex k of the coarse mesh, moved to the nearest
/// template vertex that is still free. The edges are those of the coarse mesh. The weights fall with the distance as
/// `falloff` says. A vertex beyond the reach of all nodes uses the nodes within twice that, or else the nearest node.
/// @throws Error when the coarse mesh has more vertices than the template
EmbeddedGraph build_graph(const TriangleMesh& mesh, const TriangleMesh& coarse, const GraphOptions& options = {});
/// As above, from the template decimated to `num_nodes` vertices.
EmbeddedGraph build_graph(const TriangleMesh& mesh, int num_nodes, const GraphOptions& options = {});

}  // namespace doppel
