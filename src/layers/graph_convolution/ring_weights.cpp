#include <algorithm>
#include <numeric>

#include "doppel/character/embedded_graph.h"
#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"

namespace doppel {

namespace {

/// The a_kl of one node, neighbours ascending by (hops, node).
struct Row {
  std::vector<int> nodes;
  std::vector<double> weights;
};

std::vector<Row> weight_rows(const MeshTopology& topology, int rings) {
  std::vector<Row> rows(topology.num_vertices());
  for (int k = 0; k < topology.num_vertices(); ++k) {
    double total = 0.0;
    for (const auto& [node, hops] : topology.ball(k, rings - 1)) {
      rows[k].nodes.push_back(node);
      rows[k].weights.push_back(rings - hops);
      total += rings - hops;
    }
    for (double& weight : rows[k].weights) weight /= total;
  }
  return rows;
}

/// Breadth-first order from the last node that a first search reaches (a far end of each component). Nodes that are
/// close on the graph are close in the order.
std::vector<int> breadth_first(const MeshTopology& topology, int start, std::vector<char>& seen) {
  std::vector<int> queue{start};
  seen[start] = 1;
  for (std::size_t at = 0; at < queue.size(); ++at)
    for (const int next : topology.one_ring().row(queue[at]))
      if (!seen[next]) {
        seen[next] = 1;
        queue.push_back(next);
      }
  return queue;
}

std::vector<int> near_order(const MeshTopology& topology) {
  std::vector<char> found(topology.num_vertices(), 0), placed(topology.num_vertices(), 0);
  std::vector<int> order;
  for (int k = 0; k < topology.num_vertices(); ++k) {
    if (placed[k]) continue;
    const int far_end = breadth_first(topology, k, found).back();
    const std::vector<int> component = breadth_first(topology, far_end, placed);
    order.insert(order.end(), component.begin(), component.end());
  }
  return order;
}

torch::Tensor int_tensor(const std::vector<int32_t>& values) {
  return torch::tensor(at::ArrayRef<int32_t>(values), torch::kInt32);
}

void fill_padded(const std::vector<Row>& rows, RingWeights& ring) {
  std::size_t longest = 0;
  for (const Row& row : rows) longest = std::max(longest, row.nodes.size());
  const auto K = static_cast<int64_t>(rows.size());
  ring.neighbours = torch::zeros({K, static_cast<int64_t>(longest)}, torch::kInt64);
  ring.weights = torch::zeros({K, static_cast<int64_t>(longest)}, torch::kFloat64);
  auto neighbours = ring.neighbours.accessor<int64_t, 2>();
  auto weights = ring.weights.accessor<double, 2>();
  for (int64_t k = 0; k < K; ++k)
    for (std::size_t e = 0; e < rows[k].nodes.size(); ++e) {
      neighbours[k][e] = rows[k].nodes[e];
      weights[k][e] = rows[k].weights[e];
    }
  ring.weights_float = ring.weights.to(torch::kFloat32);
}

void fill_entries(const std::vector<Row>& rows, RingWeights& ring) {
  std::vector<int32_t> nodes, offsets;
  std::vector<double> weights;
  for (const Row& row : rows) {
    offsets.push_back(static_cast<int32_t>(nodes.size()));
    nodes.insert(nodes.end(), row.nodes.begin(), row.nodes.end());
    weights.insert(weights.end(), row.weights.begin(), row.weights.end());
  }
  ring.entries = int_tensor(nodes);
  ring.entry_offsets = int_tensor(offsets);
  ring.entry_weights = torch::tensor(at::ArrayRef<double>(weights), torch::kFloat64);
  ring.entry_weights_float = ring.entry_weights.to(torch::kFloat32);
}

void fill_packed(const std::vector<Row>& rows, const std::vector<int>& order, RingWeights& ring) {
  std::vector<int32_t> position(order.size()), offsets{0}, columns;
  for (std::size_t p = 0; p < order.size(); ++p) position[order[p]] = static_cast<int32_t>(p);
  std::vector<float> values, transposed;
  const auto weight_of = [&](int k, int l) {
    const auto found = std::find(rows[k].nodes.begin(), rows[k].nodes.end(), l);
    return static_cast<float>(rows[k].weights[found - rows[k].nodes.begin()]);
  };
  for (const int k : order) {
    std::vector<int> nodes = rows[k].nodes;
    std::sort(nodes.begin(), nodes.end(), [&](int a, int b) { return position[a] < position[b]; });
    for (const int l : nodes) {
      columns.push_back(position[l]);
      values.push_back(weight_of(k, l));
      transposed.push_back(weight_of(l, k));
    }
    offsets.push_back(static_cast<int32_t>(columns.size()));
  }
  ring.num_entries = static_cast<int64_t>(columns.size());
  ring.order = int_tensor({order.begin(), order.end()});
  ring.positions = int_tensor(position);
  ring.offsets = int_tensor(offsets);
  ring.columns = int_tensor(columns);
  ring.values = torch::tensor(at::ArrayRef<float>(values), torch::kFloat32);
  ring.transposed_values = torch::tensor(at::ArrayRef<float>(transposed), torch::kFloat32);
}

}  // namespace

RingWeights RingWeights::from_topology(const MeshTopology& topology, int rings) {
  if (rings < 1) fail("ring weights need at least one ring (the node itself), received R = {}", rings);
  if (topology.num_vertices() == 0) fail("ring weights need a graph with nodes, received an empty one");
  RingWeights ring;
  ring.num_nodes = topology.num_vertices();
  ring.rings = rings;
  const std::vector<Row> rows = weight_rows(topology, rings);
  fill_padded(rows, ring);
  fill_entries(rows, ring);
  fill_packed(rows, near_order(topology), ring);
  return ring;
}

RingWeights RingWeights::from_graph(const EmbeddedGraph& graph, int rings) {
  return from_topology(MeshTopology(graph.num_nodes(), graph.edges), rings);
}

}  // namespace doppel
