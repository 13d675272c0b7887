#include "doppel/layers/embedded_deformation/embedded_deformation.h"

#include "doppel/core/error.h"

namespace doppel {
namespace {

torch::Tensor to_tensor(const std::vector<Eigen::Vector3d>& points) {
  const torch::Tensor result = torch::empty({static_cast<int64_t>(points.size()), 3}, torch::kFloat64);
  auto rows = result.accessor<double, 2>();
  for (size_t i = 0; i < points.size(); ++i) {
    for (int c = 0; c < 3; ++c) rows[i][c] = points[i][c];
  }
  return result;
}

std::vector<Eigen::Vector3d> node_positions(const Character& character) {
  std::vector<Eigen::Vector3d> positions;
  for (int vertex : character.graph.node_vertex) positions.push_back(character.mesh.vertices.at(vertex));
  return positions;
}

}  // namespace

DeformationGraph::DeformationGraph(const Character& character)
    : DeformationGraph(character.mesh.vertices, node_positions(character), character.graph.vertex_nodes,
                       character.graph.weights) {}

DeformationGraph::DeformationGraph(const std::vector<Eigen::Vector3d>& rest_vertices,
                                   const std::vector<Eigen::Vector3d>& node_points, const IndexRows& vertex_nodes,
                                   const std::vector<double>& node_weights)
    : rest(to_tensor(rest_vertices)),
      nodes(to_tensor(node_points)),
      weights(vertex_nodes, node_weights, static_cast<int64_t>(node_points.size()), "graph weights") {
  if (rest.size(0) != weights.num_rows) {
    fail("embedded graph: weights for {} vertices, the template has {}", weights.num_rows, rest.size(0));
  }
  // Positions relative to the centre are smaller, so single precision keeps more of their digits.
  const torch::Tensor middle = rest.size(0) > 0 ? rest.mean(0) : torch::zeros({3}, torch::kFloat64);
  centre = middle.to(torch::kFloat32);
  rest_float = (rest - centre).to(torch::kFloat32);
  nodes_float = (nodes - centre).to(torch::kFloat32);
}

EmbeddedDeformationImpl::EmbeddedDeformationImpl(const Character& character)
    : EmbeddedDeformationImpl(DeformationGraph(character)) {}

EmbeddedDeformationImpl::EmbeddedDeformationImpl(DeformationGraph graph)
    : torch::nn::Module("EmbeddedDeformation"), graph_(std::move(graph)) {}

torch::Tensor EmbeddedDeformationImpl::forward(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                               const torch::Tensor& node_transforms) const {
  return embedded_deformation(A, T, D, node_transforms, graph_);
}

void EmbeddedDeformationImpl::pretty_print(std::ostream& stream) const {
  stream << "EmbeddedDeformation(vertices=" << graph_.weights.num_rows << ", nodes=" << graph_.weights.num_columns
         << ", influences=" << graph_.weights.items.size(0) << ")";
}

}  // namespace doppel
