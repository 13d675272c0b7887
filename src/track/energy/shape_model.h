#pragma once

/// The surface and the landmarks of a body in a given pose, and their jacobians with respect to the parameters of its
/// shape (`ShapeFamily`): measures, or scales of bones. The pose is fixed; the DoFs of all shapes mean the same motion.
/// Notation: P parameters, D DoFs, N vertices, M landmarks. Metres, radians, double precision.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "doppel/character/shape_family.h"
#include "doppel/solver/dense_system.h"
#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// A character of a family that can be posed, with its landmarks.
class ShapedBody {
 public:
  /// @param landmarks [M] names of markers @throws Error for a name that no marker has
  ShapedBody(Character character, const std::vector<std::string>& landmarks);

  const Character& character() const { return *character_; }
  const PoseModel& poses() const { return poses_; }

 private:
  std::unique_ptr<const Character> character_;
  PoseModel poses_;  ///< refers to the character
};

/// The body of some parameters and, for jacobians, those with one parameter raised each.
struct ShapeNeighbours {
  std::vector<double> parameters;  ///< [P]
  std::vector<double> steps;       ///< [P] by how much each is raised; negative at the upper end of its range
  std::unique_ptr<const ShapedBody> body;
  std::vector<std::unique_ptr<const ShapedBody>> raised;  ///< [P]; empty without jacobians
};

/// Makes the bodies of a family and keeps the last ones, which all frames of a fit share. Not for several threads.
class ShapeSource {
 public:
  /// @param family must outlive the source @param landmarks [M] names of markers
  ShapeSource(const ShapeFamily& family, std::vector<std::string> landmarks);

  const ShapeFamily& family() const { return family_; }
  int num_landmarks() const { return static_cast<int>(landmarks_.size()); }
  double landmark_weight(int landmark) const { return landmark_weights_[static_cast<std::size_t>(landmark)]; }
  /// @param parameters [P] @param jacobian whether the raised bodies are needed
  std::shared_ptr<const ShapeNeighbours> at(const std::vector<double>& parameters, bool jacobian) const;

 private:
  const ShapeFamily& family_;
  std::vector<std::string> landmarks_;
  std::vector<double> landmark_weights_;  ///< [M] landmark_weight.h
  mutable std::shared_ptr<const ShapeNeighbours> last_;
};

/// A shape in the pose of the model, computed by `ShapeModel::pose`.
struct PosedShape {
  std::shared_ptr<const ShapeNeighbours> shapes;
  PosedBody body;
  std::vector<PosedBody> raised;  ///< [P]; empty when computed without jacobians

  const PoseModel& poses() const { return shapes->body->poses(); }
};

/// The model of one frame. The terms on images use it like a `PoseModel`.
class ShapeModel {
 public:
  using State = PosedShape;
  using Rows = Residuals;
  using System = DenseSystem;

  /// @param source must outlive the model @param dofs [D] the pose
  ShapeModel(const ShapeSource& source, std::vector<double> dofs) : source_(source), dofs_(std::move(dofs)) {}

  int num_unknowns() const { return source_.family().num_parameters(); }
  int num_landmarks() const { return source_.num_landmarks(); }
  double landmark_weight(int landmark) const { return source_.landmark_weight(landmark); }
  const ShapeFamily& family() const { return source_.family(); }
  std::string unknown_name(int unknown) const { return family().parameters()[unknown].name; }

  /// @param parameters [P] @param jacobian whether `add_..._jacobian` will be called
  PosedShape pose(const std::vector<double>& parameters, bool jacobian) const;
  /// The parameters after a step, within their ranges.
  std::vector<double> moved(const std::vector<double>& parameters, const Eigen::VectorXd& step) const;

  Eigen::Vector3d landmark(const PosedShape& shape, int landmark) const;
  Eigen::Vector3d vertex(const PosedShape& shape, int vertex) const;
  /// A vertex and its position. Terms use it like `PoseModel::SkinnedVertex`.
  struct SkinnedVertex {
    const PosedShape& shape;
    int vertex;
    PoseModel::SkinnedVertex skinned;

    Eigen::Vector3d position() const { return skinned.position(); }
  };
  SkinnedVertex skinned(const PosedShape& shape, int vertex) const;
  Eigen::Vector3d normal(const SkinnedVertex& vertex) const;
  Eigen::Vector3d normal(const PosedShape& shape, int vertex) const { return normal(skinned(shape, vertex)); }

  /// Adds gradient^T d point / d parameters to a row, by forward differences.
  using Row = Rows::JacobianRow;
  void add_landmark_jacobian(const PosedShape& shape, int landmark, const Eigen::Vector3d& gradient, Row row) const;
  void add_vertex_jacobian(const PosedShape& shape, const SkinnedVertex& vertex, const Eigen::Vector3d& gradient,
                           Row row) const;
  void add_vertex_jacobian(const PosedShape& shape, int vertex, const Eigen::Vector3d& gradient, const Row& row) const {
    add_vertex_jacobian(shape, skinned(shape, vertex), gradient, row);
  }

 private:
  const ShapeSource& source_;
  std::vector<double> dofs_;
};

}  // namespace doppel
