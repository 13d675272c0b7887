#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// How far is a node from a vertex: edges on the template (`hops`, what public checkpoints use), or path length.
enum class GraphMetric { hops, geodesic };

struct GraphOptions {
  GraphMetric metric = GraphMetric::hops;
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

/// Builds the graph from a coarse mesh of the template (node k = its vertex k, moved to the nearest template vertex not
/// yet taken; edges = its edges). w ∝ exp(-1/2 (d/r)^2) for d <= r; a vertex nobody reaches takes nodes
/// within 2 r, then the nearest node.
/// @throws Error when the coarse mesh has more vertices than the template
EmbeddedGraph build_graph(const TriangleMesh& mesh, const TriangleMesh& coarse, const GraphOptions& options = {});
/// Decimates the template to `num_nodes` first.
EmbeddedGraph build_graph(const TriangleMesh& mesh, int num_nodes, const GraphOptions& options = {});

}  // namespace doppel
