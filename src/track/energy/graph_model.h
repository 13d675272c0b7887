#pragma once

/// The surface of a character in one pose, deformed by its embedded graph, and its jacobian:
///
///   y_i = sum_k w_ik (R(A_k) (v_i - g_k) + g_k + T_k)          Equation: 6.2
///   x_i = sum_k w_ik M_k y_i                                    Equation: 6.3
///
/// with R(A) = Rz(A_3) Ry(A_2) Rx(A_1) and M_k the motion of node k from the rest pose, as in
/// `CharacterSurface::deformed`. The pose is fixed; the unknowns are A and T of all nodes, six numbers per node.
/// Notation: K nodes, N vertices, M landmarks. Metres, radians, double precision.

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/solver/block_system.h"
#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// An embedded graph and its parameters, computed by `GraphModel::pose`.
struct DeformedGraph {
  std::vector<double> parameters;  ///< [6K] A_k, T_k of one node after the other
  std::vector<Eigen::Matrix3d> rotation;
  std::vector<Eigen::Vector3d> position;  ///< g_k + T_k
  /// [K] d rotation / d A_1, A_2, A_3. Empty when computed without jacobians.
  std::vector<std::array<Eigen::Matrix3d, 3>> rotation_jacobian;
};

class GraphModel {
 public:
  using State = DeformedGraph;
  using Rows = BlockResiduals;
  using System = BlockSystem;

  /// Begins in the rest pose. @param landmarks points on joints; each moves with the node nearest to it (5.12)
  /// @throws Error when the character has no graph
  GraphModel(const Character& character, const std::vector<Marker>& landmarks);

  /// Sets the pose of surface and landmarks. @param dofs [D]
  void set_pose(const std::vector<double>& dofs);

  int num_nodes() const { return static_cast<int>(nodes_.size()); }
  int num_unknowns() const { return kBlockSize * num_nodes(); }
  int num_landmarks() const { return static_cast<int>(landmark_node_.size()); }
  double landmark_weight(int landmark) const { return poses_.landmark_weight(landmark); }
  const Character& character() const { return poses_.character(); }
  const std::vector<Eigen::Vector3d>& nodes() const { return nodes_; }  ///< [K] g_k
  std::string unknown_name(int unknown) const;
  std::vector<double> undeformed() const { return std::vector<double>(num_unknowns(), 0.0); }

  /// @param parameters [6K] @param jacobian whether `add_..._jacobian` will be called
  DeformedGraph pose(const std::vector<double>& parameters, bool jacobian) const;
  std::vector<double> moved(const std::vector<double>& parameters, const Eigen::VectorXd& step) const;

  Eigen::Vector3d canonical_vertex(const DeformedGraph& graph, int vertex) const;  ///< y_i
  Eigen::Vector3d vertex(const DeformedGraph& graph, int vertex) const;            ///< x_i
  /// A vertex and its position. Terms use it like `PoseModel::SkinnedVertex`.
  struct SkinnedVertex {
    const DeformedGraph& graph;
    int vertex;
    Eigen::Vector3d point;

    const Eigen::Vector3d& position() const { return point; }
  };
  SkinnedVertex skinned(const DeformedGraph& graph, int vertex) const {
    return {graph, vertex, this->vertex(graph, vertex)};
  }
  Eigen::Vector3d normal(const SkinnedVertex& vertex) const { return normal(vertex.graph, vertex.vertex); }
  /// Unit normal of the template, rotated by graph and pose.
  Eigen::Vector3d normal(const DeformedGraph& graph, int vertex) const;
  /// World position of a landmark: its node deforms it, its joint poses it.
  Eigen::Vector3d landmark(const DeformedGraph& graph, int landmark) const;

  /// Adds gradient^T d point / d unknowns to a row.
  using Row = Rows::JacobianRow;
  void add_vertex_jacobian(const DeformedGraph& graph, int vertex, const Eigen::Vector3d& gradient, Row row) const;
  void add_vertex_jacobian(const DeformedGraph& graph, const SkinnedVertex& vertex, const Eigen::Vector3d& gradient,
                           Row row) const {
    add_vertex_jacobian(graph, vertex.vertex, gradient, row);
  }
  void add_landmark_jacobian(const DeformedGraph& graph, int landmark, const Eigen::Vector3d& gradient, Row row) const;
  /// The same for a point of the canonical pose that moves with one node. @param weight factor of the jacobian
  /// @param rest offset from the node in the rest pose
  void add_node_jacobian(const DeformedGraph& graph, int node, double weight, const Eigen::Vector3d& rest,
                         const Eigen::Vector3d& gradient, Row row) const;

 private:
  PoseModel poses_;
  std::vector<Eigen::Vector3d> nodes_, normals_;
  std::vector<int> landmark_node_;               ///< [M]
  std::vector<Eigen::Vector3d> landmark_rest_;   ///< [M]
  std::vector<Eigen::Affine3d> landmark_joint_;  ///< [M] joint from rest
  std::vector<Eigen::Affine3d> vertex_movement_, landmark_movement_;
};

/// The deformed surface, [N] world metres.
std::vector<Eigen::Vector3d> deformed_vertices(const GraphModel& model, const DeformedGraph& graph);

}  // namespace doppel
