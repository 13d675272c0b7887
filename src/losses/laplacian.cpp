#include "doppel/losses/laplacian.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

namespace {

/// w_i of a vertex with neighbours. @param rigidity s_i [N]
double laplacian_weight(const IndexRows& rings, const std::vector<double>& rigidity, int vertex,
                        LaplacianWeights weights) {
  if (weights == LaplacianWeights::vertex) return rigidity[vertex];
  double sum = 0.0;
  for (const int j : rings.row(vertex)) sum += 0.5 * (rigidity[vertex] + rigidity[j]);
  return sum / rings.size(vertex);
}

}  // namespace

LaplacianGraph::LaplacianGraph(const Character& character, const LaplacianOptions& options)
    : LaplacianGraph(MeshTopology(character.mesh),
                     vertex_rigidity(character.labels, character.num_vertices(), options.rigidity), options.weights) {}

LaplacianGraph::LaplacianGraph(const MeshTopology& topology, const std::vector<double>& rigidity,
                               LaplacianWeights weights)
    : num_vertices(topology.num_vertices()) {
  const IndexRows& rings = topology.one_ring();
  if (rigidity.size() != as_size(num_vertices))
    fail("Laplacian graph: {} vertices but {} rigidities", num_vertices, rigidity.size());
  num_edges = static_cast<std::int64_t>(rings.items.size());
  offsets = torch::tensor(rings.offsets, torch::kInt32);
  neighbours = torch::tensor(rings.items, torch::kInt32);
  target = neighbours.to(torch::kInt64);
  source = torch::empty({num_edges}, torch::kInt64);
  weight = torch::zeros({num_vertices}, torch::kFloat64);
  for (int i = 0; i < rings.num_rows(); ++i) {
    if (rings.size(i) > 0) weight.data_ptr<double>()[i] = laplacian_weight(rings, rigidity, i, weights);
    for (int e = rings.offsets[i]; e < rings.offsets[i + 1]; ++e) source.data_ptr<std::int64_t>()[e] = i;
  }
  weight_float = weight.to(torch::kFloat32);
}

torch::Tensor laplacian_loss_reference(const torch::Tensor& V_fi, const torch::Tensor& V_co,
                                       const LaplacianGraph& graph) {
  check_shape("laplacian_loss", "V_fi", V_fi, {-1, graph.num_vertices, 3}, "[B,N,3]");
  check_shape("laplacian_loss", "V_co", V_co, {V_fi.size(0), graph.num_vertices, 3}, "[B,N,3]");
  if (V_fi.numel() == 0 || graph.num_edges == 0) return V_fi.sum() * 0.0;
  const torch::Tensor source = index_like(graph.source, V_fi), target = index_like(graph.target, V_fi);
  const torch::Tensor displacement = V_fi - V_co.detach();
  const torch::Tensor along_edges = displacement.index_select(1, source) - displacement.index_select(1, target);
  const torch::Tensor laplacian = torch::zeros_like(displacement).index_add(1, source, along_edges);
  const torch::Tensor sum = (laplacian.square().sum(-1) * constant_like(graph.weight, V_fi)).sum();
  return sum / static_cast<double>(V_fi.size(0) * graph.num_edges);
}

}  // namespace doppel
