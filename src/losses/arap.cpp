#include "doppel/losses/arap.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

std::vector<Eigen::Vector3d> node_positions(const Character& character) {
  std::vector<Eigen::Vector3d> positions;
  for (int vertex : character.graph.node_vertex) positions.push_back(character.mesh.vertices.at(vertex));
  return positions;
}

std::vector<std::array<int, 2>> directed(const std::vector<std::array<int, 2>>& edges) {
  std::vector<std::array<int, 2>> both;
  for (const auto& [k, l] : edges) {
    both.push_back({k, l});
    both.push_back({l, k});
  }
  std::sort(both.begin(), both.end());
  return both;
}

}  // namespace

ArapGraph::ArapGraph(const Character& character)
    : ArapGraph(node_positions(character), character.graph.edges, node_rigidity(character.rigidity, character.graph)) {}

ArapGraph::ArapGraph(const std::vector<Eigen::Vector3d>& nodes, const std::vector<std::array<int, 2>>& edges,
                     const std::vector<double>& node_rigidity)
    : num_nodes(static_cast<int64_t>(nodes.size())) {
  const int K = static_cast<int>(nodes.size());
  if (node_rigidity.size() != nodes.size()) {
    fail("ARAP graph: {} nodes but {} rigidities", nodes.size(), node_rigidity.size());
  }
  for (const auto& [k, l] : edges) {
    if (k < 0 || l < 0 || k >= K || l >= K || k == l) fail("ARAP graph: edge {}-{} among {} nodes", k, l, K);
  }
  const auto both = directed(edges);
  const auto E = static_cast<int64_t>(both.size());
  source = torch::empty({E}, torch::kInt64);
  target = torch::empty({E}, torch::kInt64);
  rigidity = torch::empty({E}, torch::kFloat64);
  rest = torch::empty({E, 3}, torch::kFloat64);
  offsets = torch::zeros({K + 1}, torch::kInt32);
  auto* first = offsets.data_ptr<int32_t>();
  for (int64_t e = 0; e < E; ++e) {
    const auto [k, l] = both[e];
    source.data_ptr<int64_t>()[e] = k;
    target.data_ptr<int64_t>()[e] = l;
    rigidity.data_ptr<double>()[e] = 0.5 * (node_rigidity[k] + node_rigidity[l]);
    for (int c = 0; c < 3; ++c) rest.data_ptr<double>()[3 * e + c] = nodes[l][c] - nodes[k][c];
    ++first[k + 1];
  }
  for (int k = 0; k < K; ++k) first[k + 1] += first[k];
  targets = target.to(torch::kInt32);
  rigidity_float = rigidity.to(torch::kFloat32);
  rest_float = rest.to(torch::kFloat32);
}

torch::Tensor arap_loss_reference(const torch::Tensor& A, const torch::Tensor& T, const ArapGraph& graph) {
  check_shape("arap_loss", "A", A, {-1, graph.num_nodes, 3}, "[B,K,3]");
  check_shape("arap_loss", "T", T, {A.size(0), graph.num_nodes, 3}, "[B,K,3]");
  const torch::Tensor source = index_like(graph.source, A), target = index_like(graph.target, A);
  const torch::Tensor rest = constant_like(graph.rest, A);
  const torch::Tensor rotation = euler_to_matrix(A).index_select(1, source);
  const torch::Tensor predicted = (rotation * rest.unsqueeze(-2)).sum(-1) + T.index_select(1, source);
  const torch::Tensor residual = predicted - rest - T.index_select(1, target);
  if (residual.numel() == 0) return (A.sum() + T.sum()) * 0.0;
  return (residual.abs().sum(-1) * constant_like(graph.rigidity, A)).mean();
}

}  // namespace doppel
