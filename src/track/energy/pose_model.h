#pragma once

/// Positions of landmarks and skinned vertices in a pose, and their jacobians with respect to the unknowns of a fit.
///
/// The unknowns are some of the skeleton's DoFs; the others keep given values. Where the skeleton's root allows it
/// (`RootRotation::of`), a rotation about the world's axes replaces its three angles: a step omega changes the root by
/// R <- exp(omega) R, so that no pose is singular (4.2). Notation: n unknowns, J joints, Bn bones, N vertices, M
/// landmarks. Metres, radians, double precision.

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/solver/dense_system.h"
#include "doppel/track/energy/root_rotation.h"

namespace doppel {

/// A character in one pose, computed by `PoseModel::pose`.
struct PosedBody {
  std::vector<double> dofs;                       ///< [D]
  std::vector<Eigen::Affine3d> world_from_joint;  ///< [J]

  struct DualQuaternion {
    Eigen::Quaterniond real, dual;
  };
  std::vector<DualQuaternion> world_from_rest;  ///< [Bn]

  /// [carriers] twists of the joints that carry bones or landmarks, one column per unknown: angular velocity, and the
  /// velocity of the point at the world's origin. Empty when computed without jacobians.
  using Twists = Eigen::Matrix<double, 6, Eigen::Dynamic>;
  std::vector<Twists> twists;
};

class PoseModel {
 public:
  using State = PosedBody;
  using Rows = Residuals;
  using System = DenseSystem;

  /// @param landmarks points on joints; @param dofs DoFs that are unknown, in any order, each once
  PoseModel(const Character& character, std::vector<Marker> landmarks, const std::vector<int>& dofs);

  /// Replaces the surface in the rest pose, for example by a deformed template. The normals stay the template's.
  /// @param vertices [N] world metres
  void set_rest_vertices(std::vector<Eigen::Vector3d> vertices) { rest_vertices_ = std::move(vertices); }

  int num_unknowns() const { return static_cast<int>(unknowns_.size()); }
  int num_landmarks() const { return static_cast<int>(landmarks_.size()); }
  const std::vector<Marker>& landmarks() const { return landmarks_; }
  double landmark_weight(int landmark) const { return landmark_weights_[static_cast<std::size_t>(landmark)]; }
  const Character& character() const { return character_; }
  const std::optional<RootRotation>& root() const { return root_; }
  /// The name of the unknown's DoF, or `root turn x`, `root turn y`, `root turn z`.
  std::string unknown_name(int unknown) const;
  /// The DoF of an unknown; nothing for the rotation of the root.
  std::optional<int> dof_of(int unknown) const;
  /// Whether a DoF moves the whole body.
  bool moves_root(int dof) const { return moves_root_[dof]; }
  /// Metres or radians that the DoF's joints move per unit of it (root of the sum of squares).
  double reach(int dof) const { return reach_[dof]; }

  /// @param dofs [D] @param jacobian whether `add_..._jacobian` will be called
  PosedBody pose(const std::vector<double>& dofs, bool jacobian) const;
  /// The DoFs after a step of the unknowns.
  std::vector<double> moved(const std::vector<double>& dofs, const Eigen::VectorXd& step) const;
  /// [n] The step of the unknowns from one pose to another: the inverse of `moved`. The root's turn is the rotation
  /// vector of R_to R_from^T. DoFs that are not unknown are ignored.
  Eigen::VectorXd step_between(const std::vector<double>& from, const std::vector<double>& to) const;

  Eigen::Vector3d landmark(const PosedBody& body, int landmark) const;
  /// World position of a vertex, as in `CharacterSurface::skinned`.
  Eigen::Vector3d vertex(const PosedBody& body, int vertex) const;
  /// The rigid motion of a vertex from the rest pose. Its rotation blends dual quaternions in either skinning mode.
  Eigen::Affine3d movement(const PosedBody& body, int vertex) const;
  const Eigen::Vector3d& rest_normal(int vertex) const { return rest_normals_[vertex]; }
  /// A vertex in a pose: intermediate results that its position, normal and jacobian share.
  struct SkinnedVertex {
    int vertex;
    std::span<const int> bones;
    std::span<const double> weights;  ///< one for each of `bones`
    Eigen::Quaterniond real = Eigen::Quaterniond(0, 0, 0, 0), dual = Eigen::Quaterniond(0, 0, 0, 0);
    double squared_norm = 0.0;
    Eigen::Vector3d turned;  ///< the rest position, rotated but not translated
    Eigen::Vector3d translation;

    Eigen::Vector3d position() const { return turned + translation; }
    /// The weight of the i-th bone, its sign aligned with that of the first.
    double signed_weight(const PosedBody& body, std::size_t i) const;
  };
  SkinnedVertex skinned(const PosedBody& body, int vertex) const;
  /// The unit normal, rotated with the vertex.
  Eigen::Vector3d normal(const SkinnedVertex& vertex) const;
  Eigen::Vector3d normal(const PosedBody& body, int vertex) const { return normal(skinned(body, vertex)); }

  /// Adds gradient^T d point / d unknowns to a row of n numbers.
  using Row = Rows::JacobianRow;
  void add_landmark_jacobian(const PosedBody& body, int landmark, const Eigen::Vector3d& gradient,
                             const Row& row) const;
  void add_vertex_jacobian(const PosedBody& body, const SkinnedVertex& vertex, const Eigen::Vector3d& gradient,
                           const Row& row) const;
  void add_vertex_jacobian(const PosedBody& body, int vertex, const Eigen::Vector3d& gradient, const Row& row) const {
    add_vertex_jacobian(body, skinned(body, vertex), gradient, row);
  }

 private:
  struct Unknown {
    int dof = -1, root_axis = -1;
  };
  /// An unknown that drives a joint above a carrier, or the carrier itself.
  struct Handle {
    int joint, unknown;
    double weight;
  };
  int carrier_of(int joint);
  void add_force(const PosedBody& body, std::size_t carrier, const Eigen::Matrix<double, 6, 1>& force, Row row) const;
  void add_twists(PosedBody& body) const;
  Eigen::Vector3d moved_by_bone(const PosedBody& body, int bone, int vertex) const;
  void find_root_dofs();

  const Character& character_;
  std::vector<Marker> landmarks_;
  std::optional<RootRotation> root_;  ///< only when its rotations are unknown
  std::vector<Unknown> unknowns_;
  std::vector<double> reach_;                     ///< [D]
  std::vector<bool> moves_root_;                  ///< [D]
  std::vector<int> carrier_joint_;                ///< [carriers]
  std::vector<std::vector<Handle>> handles_;      ///< [carriers]
  std::vector<bool> turned_;                      ///< [carriers] whether the root's rotation moves it
  std::vector<std::vector<int>> movers_;          ///< [carriers] unknowns that move it
  std::vector<int> landmark_carrier_;             ///< [M]
  std::vector<double> landmark_weights_;          ///< [M] landmark_weight.h
  std::vector<int> bone_carrier_;                 ///< [Bn]
  std::vector<Eigen::Affine3d> joint_from_rest_;  ///< [Bn] inverse of the bone's joint in the rest pose
  std::vector<Eigen::Vector3d> rest_vertices_;    ///< [N]
  std::vector<Eigen::Vector3d> rest_normals_;     ///< [N]
};

}  // namespace doppel
