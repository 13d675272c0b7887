#include "doppel/track/energy/graph_model.h"

#include <cmath>

#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Rz Ry Rx. Where an axis is given, the derivative replaces the factor of that axis.
Matrix3d rotation_of(const Vector3d& angles, int jacobian_of = -1) {
  Matrix3d result = Matrix3d::Identity();
  for (int axis = 2; axis >= 0; --axis) {
    Matrix3d factor = Eigen::AngleAxisd(angles[axis], Vector3d::Unit(axis)).toRotationMatrix();
    if (axis == jacobian_of) {
      // d Rot(a) / da = [axis]x Rot(a)
      const Vector3d unit = Vector3d::Unit(axis);
      for (int column = 0; column < 3; ++column) factor.col(column) = unit.cross(factor.col(column)).eval();
    }
    result = result * factor;
  }
  return result;
}

}  // namespace

GraphModel::GraphModel(const Character& character, const std::vector<Marker>& landmarks)
    : poses_(character, landmarks, {}), normals_(vertex_normals(character.mesh)) {
  if (character.num_nodes() == 0) fail("the surface cannot be deformed: the character has no embedded graph");
  for (const int vertex : character.graph.node_vertex) nodes_.push_back(character.mesh.vertices[vertex]);
  if (!landmarks.empty()) landmark_node_ = nearest_nodes(character, landmarks);
  landmark_rest_ = landmark_positions(character.skeleton, landmarks, character.rest_dofs);
  const std::vector<Affine3d> rest = character.skeleton.pose(character.rest_dofs);
  for (const Marker& landmark : landmarks) landmark_joint_.push_back(rest[landmark.joint].inverse(Eigen::Isometry));
  set_pose(character.rest_dofs);
}

void GraphModel::set_pose(const std::vector<double>& dofs) {
  const PosedBody body = poses_.pose(dofs, false);
  const EmbeddedGraph& graph = character().graph;
  std::vector<Affine3d> node_movement;
  for (const int vertex : graph.node_vertex) node_movement.push_back(poses_.movement(body, vertex));
  vertex_movement_.clear();
  for (int v = 0; v < character().num_vertices(); ++v) {
    Affine3d blend(Eigen::Matrix4d::Zero());
    for (int i = graph.vertex_nodes.offsets[v]; i < graph.vertex_nodes.offsets[v + 1]; ++i)
      blend.matrix() += graph.weights[i] * node_movement[graph.vertex_nodes.items[i]].matrix();
    vertex_movement_.push_back(blend);
  }
  landmark_movement_.clear();
  for (int m = 0; m < num_landmarks(); ++m) {
    const auto joint = as_size(poses_.landmarks()[m].joint);
    landmark_movement_.push_back(body.world_from_joint[joint] * landmark_joint_[m]);
  }
}

std::string GraphModel::unknown_name(int unknown) const {
  const int i = unknown % kBlockSize;
  return "node " + std::to_string(unknown / kBlockSize) + (i < 3 ? " angle " : " translation ") + "xyz"[i % 3];
}

DeformedGraph GraphModel::pose(const std::vector<double>& parameters, bool jacobian) const {
  DeformedGraph graph;
  graph.parameters = parameters;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const double* p = parameters.data() + kBlockSize * k;
    const Vector3d angles(p[0], p[1], p[2]);
    graph.rotation.push_back(rotation_of(angles));
    graph.position.emplace_back(nodes_[k] + Vector3d(p[3], p[4], p[5]));
    if (jacobian)
      graph.rotation_jacobian.push_back({rotation_of(angles, 0), rotation_of(angles, 1), rotation_of(angles, 2)});
  }
  return graph;
}

std::vector<double> GraphModel::moved(const std::vector<double>& parameters, const Eigen::VectorXd& step) const {
  std::vector<double> result = parameters;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] += step[static_cast<Eigen::Index>(i)];
  return result;
}

Vector3d GraphModel::canonical_vertex(const DeformedGraph& graph, int vertex) const {
  const EmbeddedGraph& weights = character().graph;
  const Vector3d& rest = character().mesh.vertices[vertex];
  Vector3d sum = Vector3d::Zero();
  for (int i = weights.vertex_nodes.offsets[vertex]; i < weights.vertex_nodes.offsets[vertex + 1]; ++i) {
    const auto k = as_size(weights.vertex_nodes.items[i]);
    sum += weights.weights[i] * (graph.rotation[k] * (rest - nodes_[k]) + graph.position[k]);
  }
  return sum;
}

Vector3d GraphModel::vertex(const DeformedGraph& graph, int vertex) const {
  return vertex_movement_[vertex] * canonical_vertex(graph, vertex);
}

Vector3d GraphModel::normal(const DeformedGraph& graph, int vertex) const {
  const EmbeddedGraph& weights = character().graph;
  Vector3d sum = Vector3d::Zero();
  for (int i = weights.vertex_nodes.offsets[vertex]; i < weights.vertex_nodes.offsets[vertex + 1]; ++i)
    sum += weights.weights[i] * (graph.rotation[weights.vertex_nodes.items[i]] * normals_[vertex]);
  return (vertex_movement_[vertex].linear() * sum).normalized();
}

Vector3d GraphModel::landmark(const DeformedGraph& graph, int landmark) const {
  const auto m = as_size(landmark), k = as_size(landmark_node_[m]);
  return landmark_movement_[m] * (graph.rotation[k] * (landmark_rest_[m] - nodes_[k]) + graph.position[k]);
}

void GraphModel::add_node_jacobian(const DeformedGraph& graph, int node, double weight, const Vector3d& rest,
                                   const Vector3d& gradient, Row row) const {
  Block& block = row.block(node);
  const auto& jacobian = graph.rotation_jacobian[node];
  for (int axis = 0; axis < 3; ++axis) block[axis] += weight * gradient.dot(jacobian[axis] * rest);
  block.tail<3>() += weight * gradient;
}

void GraphModel::add_vertex_jacobian(const DeformedGraph& graph, int vertex, const Vector3d& gradient, Row row) const {
  const EmbeddedGraph& weights = character().graph;
  const Vector3d& rest = character().mesh.vertices[vertex];
  const Vector3d canonical = vertex_movement_[vertex].linear().transpose() * gradient;
  for (int i = weights.vertex_nodes.offsets[vertex]; i < weights.vertex_nodes.offsets[vertex + 1]; ++i) {
    const int k = weights.vertex_nodes.items[i];
    add_node_jacobian(graph, k, weights.weights[i], rest - nodes_[k], canonical, row);
  }
}

void GraphModel::add_landmark_jacobian(const DeformedGraph& graph, int landmark, const Vector3d& gradient,
                                       Row row) const {
  const auto m = as_size(landmark);
  const int k = landmark_node_[m];
  add_node_jacobian(graph, k, 1.0, landmark_rest_[m] - nodes_[k], landmark_movement_[m].linear().transpose() * gradient,
                    row);
}

std::vector<Vector3d> deformed_vertices(const GraphModel& model, const DeformedGraph& graph) {
  std::vector<Vector3d> vertices;
  vertices.reserve(model.character().num_vertices());
  for (int v = 0; v < model.character().num_vertices(); ++v) vertices.push_back(model.vertex(graph, v));
  return vertices;
}

}  // namespace doppel
