#include "doppel/losses/isometry.h"

#include "doppel/core/tensor/checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Lengths of edges. @param vertices [B,N,3] @param ends int64 [E,2] @return [B,E]
Tensor edge_lengths(const Tensor& vertices, const Tensor& ends) {
  const int64_t B = vertices.size(0), N = vertices.size(1);
  const Tensor item = torch::arange(B, ends.options()).view({B, 1, 1}) * N;
  const Tensor corners = torch::embedding(vertices.reshape({B * N, 3}), ends.unsqueeze(0) + item);  // [B,E,2,3]
  const Tensor squared = (corners.select(2, 0) - corners.select(2, 1)).square().sum(-1);
  const Tensor some = squared > 0;
  return torch::where(some, torch::where(some, squared, torch::ones_like(squared)).sqrt(), torch::zeros_like(squared));
}

}  // namespace

EdgeLengths::EdgeLengths(const MeshTopology& topology, const Tensor& rest) : num_vertices(topology.num_vertices()) {
  check_shape("isometry_loss", "rest", rest, {num_vertices, 3}, "[N,3]");
  ends = torch::empty({static_cast<int64_t>(topology.edges().size()), 2}, torch::kInt64);
  int64_t* out = ends.data_ptr<int64_t>();
  for (const auto& edge : topology.edges())
    for (int vertex : edge) *out++ = vertex;
  length = edge_lengths(rest.detach().to(torch::kFloat64).unsqueeze(0), ends).squeeze(0);
}

Tensor isometry_loss(const Tensor& vertices, const EdgeLengths& rest) {
  check_shape("isometry_loss", "vertices", vertices, {-1, rest.num_vertices, 3}, "[B,N,3]");
  if (vertices.numel() == 0 || rest.ends.size(0) == 0) return vertices.sum() * 0.0;
  // The mean over undirected edges is that over directed ones.
  const Tensor length = edge_lengths(vertices, index_like(rest.ends, vertices));
  return (length - constant_like(rest.length, vertices)).square().mean();
}

}  // namespace doppel
