#include "doppel/layers/landmarks/landmarks.h"

#include "doppel/character/landmarks.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

LandmarksImpl::LandmarksImpl(const Skeleton& skeleton, const std::vector<Marker>& landmarks)
    : torch::nn::Module("Landmarks"), chain_(skeleton), frames_(marker_frames(skeleton, landmarks)) {}

Tensor LandmarksImpl::forward(const Tensor& dofs) const {
  return forward_kinematics(dofs, chain_, frames_).select(-1, 3);
}

void LandmarksImpl::pretty_print(std::ostream& stream) const { stream << "Landmarks(" << size() << ")"; }

Tensor turn_points(const Tensor& rotation, const Tensor& points) {
  check_shape("turn_points", "points", points, {-1, -1, 3}, "[B,M,3]");
  check_shape("turn_points", "rotation", rotation, {points.size(0), 3, 3}, "[B,3,3]");
  return torch::matmul(points, rotation.transpose(-2, -1));
}

GraphLandmarksImpl::GraphLandmarksImpl(const Character& character, const std::vector<Marker>& landmarks)
    : torch::nn::Module("GraphLandmarks") {
  nodes_ = nearest_nodes(character, landmarks);
  std::vector<Eigen::Vector3d> node_positions;
  for (int vertex : character.graph.node_vertex) node_positions.push_back(character.mesh.vertices[vertex]);
  IndexRows rows;
  for (int node : nodes_) {
    rows.items.push_back(node);
    rows.offsets.push_back(static_cast<int>(rows.items.size()));
  }
  const std::vector<double> weights(landmarks.size(), 1.0);
  deformation_ = EmbeddedDeformation(DeformationGraph(
      landmark_positions(character.skeleton, landmarks, character.rest_dofs), node_positions, rows, weights));
}

Tensor GraphLandmarksImpl::forward(const Tensor& A, const Tensor& T, const Tensor& node_transforms) const {
  return deformation_->forward(A, T, {}, node_transforms);
}

}  // namespace doppel
