#include "doppel/character/embedded_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "doppel/character/coarse_mesh.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

namespace {

/// Distances on the template in the chosen metric, from one vertex, up to a limit.
class TemplateDistance {
 public:
  TemplateDistance(const TriangleMesh& mesh, GraphMetric metric) : mesh_(mesh), topology_(mesh), metric_(metric) {
    if (metric == GraphMetric::geodesic) unit_ = mean_edge_length();
  }

  /// One hop, or the mean edge length in metres.
  double unit() const { return unit_; }

  std::vector<std::pair<int, double>> ball(int source, double limit) const {
    if (metric_ == GraphMetric::geodesic) return topology_.geodesic_ball(source, limit, mesh_.vertices);
    std::vector<std::pair<int, double>> result;
    for (const auto& [vertex, hops] : topology_.ball(source, static_cast<int>(std::floor(limit))))
      result.emplace_back(vertex, hops);
    return result;
  }

  /// The largest distance from `source` to any of the reachable `targets`.
  double farthest(int source, const std::vector<int>& targets, double first_limit) const {
    std::size_t previous = 0;
    for (double limit = first_limit;; limit *= 2.0) {
      const auto reached = ball(source, limit);
      double largest = 0.0;
      std::size_t found = 0;
      for (const auto& [vertex, distance] : reached)
        if (std::binary_search(targets.begin(), targets.end(), vertex)) {
          ++found;
          largest = std::max(largest, distance);
        }
      if (found == targets.size() || reached.size() == previous) return largest;
      previous = reached.size();
    }
  }

 private:
  double mean_edge_length() const {
    double sum = 0.0;
    for (const auto& [a, b] : topology_.edges()) sum += (mesh_.vertices[a] - mesh_.vertices[b]).norm();
    if (!(sum > 0.0)) fail("the template's edges have no length, so distances along them are undefined");
    return sum / static_cast<double>(topology_.edges().size());
  }

  const TriangleMesh& mesh_;
  MeshTopology topology_;
  GraphMetric metric_;
  double unit_ = 1.0;
};

/// For each coarse vertex the nearest template vertex that is still free; the lower index if two are equally near.
std::vector<int> choose_nodes(const TriangleMesh& mesh, const TriangleMesh& coarse) {
  std::vector<int> node_vertex;
  std::vector<bool> taken(mesh.vertices.size(), false);
  for (const Eigen::Vector3d& position : coarse.vertices) {
    double smallest = std::numeric_limits<double>::infinity();
    int nearest = -1;
    for (int v = 0; v < mesh.num_vertices(); ++v) {
      const double distance = (mesh.vertices[v] - position).squaredNorm();
      if (distance < smallest && !taken[v]) {
        smallest = distance;
        nearest = v;
      }
    }
    if (nearest < 0) fail("the graph's vertex {} has no finite position", node_vertex.size());
    taken[nearest] = true;
    node_vertex.push_back(nearest);
  }
  return node_vertex;
}

/// The radius of each node.
std::vector<double> choose_radii(const EmbeddedGraph& graph, const TemplateDistance& distance,
                                 const GraphOptions& options) {
  const double minimum = options.minimum_radius * distance.unit();
  std::vector<double> radius(graph.num_nodes(), minimum);
  if (!options.adaptive_radius) return radius;
  std::vector<std::vector<int>> neighbours(graph.num_nodes());
  for (const auto& [k, l] : graph.edges) {
    neighbours[k].push_back(graph.node_vertex[l]);
    neighbours[l].push_back(graph.node_vertex[k]);
  }
  for (int k = 0; k < graph.num_nodes(); ++k) {
    std::sort(neighbours[k].begin(), neighbours[k].end());
    double half = 0.5 * distance.farthest(graph.node_vertex[k], neighbours[k], 2.0 * minimum + distance.unit());
    if (options.metric == GraphMetric::hops) half = std::floor(half);
    radius[k] = std::max(minimum, half);
  }
  return radius;
}

using Influences = std::vector<std::vector<std::pair<int, double>>>;  // [N] (node, unnormalised weight)

/// The distance up to which a node has a weight, relative to its radius.
double reach_of(GraphFalloff falloff) { return falloff == GraphFalloff::smooth ? 1.5 : 1.0; }

/// The weight of a node before the weights of a vertex are normalised.
/// @param relative distance from the node divided by its radius @param widening how much farther the weights reach
double weight_at(GraphFalloff falloff, double relative, double widening) {
  if (falloff == GraphFalloff::truncated) return std::exp(-0.5 * relative * relative);
  const double x = relative / (reach_of(falloff) * widening);
  return x < 1.0 ? (1.0 - x * x) * (1.0 - x * x) : 0.0;
}

/// Adds the influences of each node on the vertices of `wanted` within `widening` times the reach of the node.
void spread(const EmbeddedGraph& graph, const TemplateDistance& distance, GraphFalloff falloff, double widening,
            const std::vector<bool>& wanted, Influences& influences) {
  for (int k = 0; k < graph.num_nodes(); ++k)
    for (const auto& [vertex, d] :
         distance.ball(graph.node_vertex[k], widening * reach_of(falloff) * graph.radius[k])) {
      if (!wanted[vertex]) continue;
      const double weight = weight_at(falloff, d / graph.radius[k], widening);
      if (weight > 0.0) influences[vertex].emplace_back(k, weight);
    }
}

int nearest_node(const TriangleMesh& mesh, const EmbeddedGraph& graph, int vertex) {
  int nearest = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < graph.num_nodes(); ++k) {
    const double d = (mesh.vertices[graph.node_vertex[k]] - mesh.vertices[vertex]).squaredNorm();
    if (d < smallest) {
      smallest = d;
      nearest = k;
    }
  }
  return nearest;
}

/// The nodes of every vertex and their weights. A vertex beyond the reach of all nodes uses twice the reach.
void weigh_vertices(const TriangleMesh& mesh, const TemplateDistance& distance, GraphFalloff falloff,
                    EmbeddedGraph& graph) {
  Influences influences(mesh.vertices.size());
  std::vector<bool> wanted(mesh.vertices.size(), true);
  spread(graph, distance, falloff, 1.0, wanted, influences);
  bool alone = false;
  for (std::size_t v = 0; v < influences.size(); ++v) {
    wanted[v] = influences[v].empty();
    alone = alone || wanted[v];
  }
  if (alone) spread(graph, distance, falloff, 2.0, wanted, influences);

  for (int v = 0; v < mesh.num_vertices(); ++v) {
    if (influences[v].empty()) influences[v].emplace_back(nearest_node(mesh, graph, v), 1.0);
    double sum = 0.0;
    for (const auto& influence : influences[v]) sum += influence.second;
    for (const auto& [node, weight] : influences[v]) {
      graph.vertex_nodes.items.push_back(node);
      graph.weights.push_back(weight / sum);
    }
    graph.vertex_nodes.offsets.push_back(static_cast<int>(graph.vertex_nodes.items.size()));
  }
}

void check_input(const TriangleMesh& mesh, const TriangleMesh& coarse, const GraphOptions& options) {
  if (mesh.vertices.empty()) fail("cannot build a graph on a template without vertices");
  if (coarse.vertices.empty()) fail("cannot build a graph from a coarse mesh without vertices");
  if (coarse.num_vertices() > mesh.num_vertices())
    fail(
        "the coarse mesh has {} vertices but the template only {}; every graph node needs a template vertex of its own",
        coarse.num_vertices(), mesh.num_vertices());
  if (options.minimum_radius < 1)
    fail("the graph's minimum radius is {}; it must be at least 1 hop", options.minimum_radius);
}

/// The decimated template. A template of several parts, or with doubled vertices along its seams, cannot be decimated.
TriangleMesh coarse_template(const TriangleMesh& mesh, int num_nodes) {
  try {
    return decimate(mesh, num_nodes);
  } catch (const Error& error) {
    log::info("{}; so the nodes of the graph are spread over the surface instead", error.what());
    return coarse_mesh(mesh, num_nodes);
  }
}

}  // namespace

EmbeddedGraph build_graph(const TriangleMesh& mesh, const TriangleMesh& coarse, const GraphOptions& options) {
  check_input(mesh, coarse, options);
  const TemplateDistance distance(mesh, options.metric);
  EmbeddedGraph graph;
  graph.node_vertex = choose_nodes(mesh, coarse);
  graph.edges = MeshTopology(coarse).edges();
  graph.faces = coarse.faces;
  graph.radius = choose_radii(graph, distance, options);
  weigh_vertices(mesh, distance, options.falloff, graph);
  return graph;
}

EmbeddedGraph build_graph(const TriangleMesh& mesh, int num_nodes, const GraphOptions& options) {
  if (num_nodes < 1 || num_nodes > mesh.num_vertices())
    fail("cannot build a graph of {} nodes; allowed is 1 to the template's {} vertices", num_nodes,
         mesh.num_vertices());
  if (num_nodes == mesh.num_vertices()) return build_graph(mesh, mesh, options);
  return build_graph(mesh, coarse_template(mesh, num_nodes), options);
}

}  // namespace doppel
