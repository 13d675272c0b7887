#include "doppel/character/embedded_graph.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>
#include <set>

#include "doppel/core/error.h"
#include "support/test_character.h"

namespace doppel::embedded_graph_test {
namespace {

using ::testing::ElementsAre;

/// A strip of two rows of `length` unit squares; vertex 2 i + row at (i, row, 0).
TriangleMesh strip(int length, double scale = 1.0) {
  TriangleMesh mesh;
  for (int i = 0; i <= length; ++i)
    for (int row = 0; row < 2; ++row) mesh.vertices.emplace_back(scale * i, scale * row, 0.0);
  for (int i = 0; i < length; ++i) {
    mesh.faces.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    mesh.faces.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  }
  return mesh;
}

TriangleMesh triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  TriangleMesh mesh;
  mesh.vertices = {a, b, c};
  mesh.faces = {{0, 1, 2}};
  return mesh;
}

double row_sum(const EmbeddedGraph& graph, int row) {
  double sum = 0.0;
  for (int i = graph.vertex_nodes.offsets[row]; i < graph.vertex_nodes.offsets[row + 1]; ++i) sum += graph.weights[i];
  return sum;
}

/// Hops between two vertices of a mesh by plain relaxation.
int slow_hops(const TriangleMesh& mesh, int from, int to) {
  std::vector<int> hops(mesh.vertices.size(), 1 << 20);
  hops[from] = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (const Triangle& face : mesh.faces)
      for (const int a : face)
        for (const int b : face)
          if (hops[a] + 1 < hops[b]) {
            hops[b] = hops[a] + 1;
            changed = true;
          }
  }
  return hops[to];
}

TEST(EmbeddedGraphReference, NodesTakeTheNearestFreeVertexAndTheLowerOfTwo) {
  const TriangleMesh mesh = strip(4);
  // The first two coarse vertices want the same vertex; the third lies midway between 6 (3,0) and 8 (4,0).
  const EmbeddedGraph graph = build_graph(mesh, triangle({1.0, 0.1, 0.0}, {1.0, 0.2, 0.0}, {3.5, -1.0, 0.0}));
  EXPECT_THAT(graph.node_vertex, ElementsAre(2, 3, 6));
  EXPECT_EQ(graph.edges, (std::vector<std::array<int, 2>>{{0, 1}, {0, 2}, {1, 2}}));
  EXPECT_EQ(graph.faces, (std::vector<Triangle>{{0, 1, 2}}));
}

TEST(EmbeddedGraphReference, WeightsFallOffWithHops) {
  const TriangleMesh mesh = strip(4);
  GraphOptions options;
  options.adaptive_radius = false;
  const EmbeddedGraph graph = build_graph(mesh, triangle({0, 0, 0}, {0, 1, 0}, {4, 0, 0}), options);
  EXPECT_THAT(graph.node_vertex, ElementsAre(0, 1, 8));
  EXPECT_THAT(graph.radius, ElementsAre(3.0, 3.0, 3.0));
  // Vertex 6 (3,0): three hops from vertex 0, three from vertex 1, one from vertex 8.
  ASSERT_EQ(graph.vertex_nodes.size(6), 3);
  double w[3], sum = 0.0;
  const double hops[] = {3.0, 3.0, 1.0};
  for (int i = 0; i < 3; ++i) sum += w[i] = std::exp(-0.5 * hops[i] * hops[i] / 9.0);
  for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(graph.weights[graph.vertex_nodes.offsets[6] + i], w[i] / sum);
}

TEST(EmbeddedGraphReference, EveryVertexIsAsTheDefinitionSays) {
  const Character character = make_test_character(3, 6, 8);
  const EmbeddedGraph& graph = character.graph;
  for (int v = 0; v < character.num_vertices(); ++v) {
    std::vector<int> nodes;
    std::vector<double> weights;
    for (int k = 0; k < graph.num_nodes(); ++k) {
      const double relative = slow_hops(character.mesh, graph.node_vertex[k], v) / graph.radius[k];
      if (relative > 1.0) continue;
      nodes.push_back(k);
      weights.push_back(std::exp(-0.5 * relative * relative));
    }
    ASSERT_FALSE(nodes.empty());
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    ASSERT_THAT(graph.vertex_nodes.row(v), ::testing::ElementsAreArray(nodes));
    for (std::size_t i = 0; i < nodes.size(); ++i)
      EXPECT_NEAR(graph.weights[graph.vertex_nodes.offsets[v] + i], weights[i] / sum, 1e-15);
  }
}

TEST(EmbeddedGraphReference, RadiusGrowsWithFarNeighbours) {
  // Neighbours 20 hops apart: half of it; with the fixed rule 3.
  const TriangleMesh mesh = strip(20);
  const TriangleMesh coarse = triangle({0, 0, 0}, {0, 1, 0}, {20, 0, 0});
  EXPECT_THAT(build_graph(mesh, coarse).radius, ElementsAre(10.0, 10.0, 10.0));
  GraphOptions fixed;
  fixed.adaptive_radius = false;
  fixed.minimum_radius = 4;
  EXPECT_THAT(build_graph(mesh, coarse, fixed).radius, ElementsAre(4.0, 4.0, 4.0));
}

TEST(EmbeddedGraphReference, LonelyVerticesTakeTwiceTheRadiusThenTheNearestNode) {
  const TriangleMesh mesh = strip(20);
  GraphOptions options;
  options.adaptive_radius = false;
  const EmbeddedGraph graph = build_graph(mesh, triangle({0, 0, 0}, {0, 1, 0}, {1, 0, 0}), options);
  EXPECT_THAT(graph.node_vertex, ElementsAre(0, 1, 2));
  const auto nodes = [&](int v) { return graph.vertex_nodes.row(v); };
  EXPECT_THAT(nodes(8), ElementsAre(2));         // (4,0): three hops from vertex 2 only
  EXPECT_THAT(nodes(10), ElementsAre(0, 1, 2));  // (5,0): five, five and four hops: within twice the radius
  EXPECT_THAT(nodes(40), ElementsAre(2));        // far beyond: the nearest
  for (int v = 0; v < mesh.num_vertices(); ++v) EXPECT_NEAR(row_sum(graph, v), 1.0, 1e-15);
}

TEST(EmbeddedGraphReference, PiecesWithoutANodeTakeTheNearest) {
  TriangleMesh mesh = strip(2);
  mesh.vertices.insert(mesh.vertices.end(), {{10, 0, 0}, {11, 0, 0}, {10, 1, 0}});
  mesh.faces.push_back({6, 7, 8});
  const EmbeddedGraph graph = build_graph(mesh, triangle({0, 0, 0}, {0, 1, 0}, {2, 0, 0}));
  for (int v = 6; v < 9; ++v) {
    ASSERT_EQ(graph.vertex_nodes.size(v), 1);
    EXPECT_EQ(graph.vertex_nodes.row(v)[0], 2);
    EXPECT_EQ(row_sum(graph, v), 1.0);
  }
}

TEST(EmbeddedGraphReference, GeodesicWeightsDoNotDependOnTheUnit) {
  GraphOptions options;
  options.metric = GraphMetric::geodesic;
  const EmbeddedGraph a = build_graph(strip(9), triangle({0, 0, 0}, {5, 1, 0}, {9, 0, 0}), options);
  const EmbeddedGraph b = build_graph(strip(9, 0.01), triangle({0, 0, 0}, {0.05, 0.01, 0}, {0.09, 0, 0}), options);
  EXPECT_EQ(a.vertex_nodes.items, b.vertex_nodes.items);
  ASSERT_EQ(a.weights.size(), b.weights.size());
  for (std::size_t i = 0; i < a.weights.size(); ++i) EXPECT_NEAR(a.weights[i], b.weights[i], 1e-12);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(a.radius[k], 100.0 * b.radius[k], 1e-12);
}

TEST(EmbeddedGraphReference, GeodesicRadiusIsThreeMeanEdges) {
  GraphOptions options;
  options.metric = GraphMetric::geodesic;
  options.adaptive_radius = false;
  const TriangleMesh mesh = strip(1);  // four sides of 1 and a diagonal
  const EmbeddedGraph graph = build_graph(mesh, triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), options);
  const double mean = (4.0 + std::sqrt(2.0)) / 5.0;
  EXPECT_NEAR(graph.radius[0], 3.0 * mean, 1e-12);
  // Vertex 3 (1,1): 2 along the sides from vertex 0, 1 from vertices 2 and 1.
  ASSERT_EQ(graph.vertex_nodes.size(3), 3);
  const auto w = [&](double d) { return std::exp(-0.5 * std::pow(d / (3.0 * mean), 2)); };
  const double sum = w(2.0) + w(1.0) + w(1.0);
  EXPECT_NEAR(graph.weights[graph.vertex_nodes.offsets[3]], w(2.0) / sum, 1e-12);
}

TEST(EmbeddedGraphReference, SmoothWeightsEndAtZero) {
  GraphOptions options;
  options.metric = GraphMetric::geodesic;
  options.falloff = GraphFalloff::smooth;
  options.adaptive_radius = false;
  const TriangleMesh mesh = strip(1);  // four sides of 1 and a diagonal
  const EmbeddedGraph graph = build_graph(mesh, triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), options);
  const double reach = 1.5 * 3.0 * (4.0 + std::sqrt(2.0)) / 5.0;
  const auto w = [&](double d) { return std::pow(1.0 - std::pow(d / reach, 2), 2); };
  // Vertex 3 (1,1): 2 along the sides from vertex 0, 1 from vertices 2 and 1.
  ASSERT_EQ(graph.vertex_nodes.size(3), 3);
  EXPECT_NEAR(graph.weights[graph.vertex_nodes.offsets[3]], w(2.0) / (w(2.0) + 2.0 * w(1.0)), 1e-12);
}

/// The largest difference of a node's weights at the two ends of an edge.
double largest_step(const TriangleMesh& mesh, const EmbeddedGraph& graph) {
  const auto weight = [&](int v, int node) {
    for (int i = graph.vertex_nodes.offsets[v]; i < graph.vertex_nodes.offsets[v + 1]; ++i)
      if (graph.vertex_nodes.items[i] == node) return graph.weights[i];
    return 0.0;
  };
  double largest = 0.0;
  const MeshTopology topology(mesh);
  for (const auto& [a, b] : topology.edges())
    for (int node = 0; node < graph.num_nodes(); ++node)
      largest = std::max(largest, std::abs(weight(a, node) - weight(b, node)));
  return largest;
}

TEST(EmbeddedGraphReference, SmoothWeightsHaveSmallerStepsAlongEdges) {
  const Character character = make_test_character(5, 12, 40);
  GraphOptions options;
  options.metric = GraphMetric::geodesic;
  const EmbeddedGraph truncated = build_graph(character.mesh, 100, options);
  options.falloff = GraphFalloff::smooth;
  const EmbeddedGraph smooth = build_graph(character.mesh, 100, options);
  EXPECT_LT(largest_step(character.mesh, smooth), 0.7 * largest_step(character.mesh, truncated));
  for (int v = 0; v < character.num_vertices(); ++v) EXPECT_NEAR(row_sum(smooth, v), 1.0, 1e-14);
}

TEST(EmbeddedGraphReference, DecimationGivesAboutTheNodesAskedFor) {
  const Character character = make_test_character(5, 12, 40);
  const EmbeddedGraph graph = build_graph(character.mesh, 100);
  EXPECT_NEAR(graph.num_nodes(), 100, 5);
  EXPECT_EQ(std::set<int>(graph.node_vertex.begin(), graph.node_vertex.end()).size(), graph.node_vertex.size());
  for (int v = 0; v < character.num_vertices(); ++v) EXPECT_NEAR(row_sum(graph, v), 1.0, 1e-14);
}

TEST(EmbeddedGraphReference, AsManyNodesAsVertices) {
  const TriangleMesh mesh = strip(3);
  const EmbeddedGraph graph = build_graph(mesh, mesh.num_vertices());
  std::vector<int> all(mesh.num_vertices());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(graph.node_vertex, all);
}

TEST(EmbeddedGraphRejects, ImpossibleInput) {
  const TriangleMesh mesh = strip(3);
  EXPECT_THROW(build_graph(mesh, strip(4)), Error);
  EXPECT_THROW(build_graph(mesh, TriangleMesh{}), Error);
  EXPECT_THROW(build_graph(TriangleMesh{}, mesh), Error);
  EXPECT_THROW(build_graph(mesh, 0), Error);
  EXPECT_THROW(build_graph(mesh, mesh.num_vertices() + 1), Error);
  GraphOptions options;
  options.minimum_radius = 0;
  EXPECT_THROW(build_graph(mesh, strip(2), options), Error);
  TriangleMesh broken = strip(1);
  broken.vertices[0].x() = std::nan("");
  EXPECT_THROW(build_graph(mesh, broken), Error);
  TriangleMesh flat = strip(3, 0.0);
  options = {};
  options.metric = GraphMetric::geodesic;
  EXPECT_THROW(build_graph(flat, strip(2), options), Error);
}

}  // namespace
}  // namespace doppel::embedded_graph_test
