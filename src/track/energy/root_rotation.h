#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// Converts the root's rotation between DoFs and a matrix. A skeleton states three angles, which are singular when the
/// second is a quarter turn. Steps, averages and extrapolations therefore use the matrix.
class RootRotation {
 public:
  /// @return nothing when the root is not three translations and then three rotations about one point, each driven by
  ///   a DoF of its own that drives nothing else
  static std::optional<RootRotation> of(const Skeleton& skeleton);

  /// World from root.
  Eigen::Matrix3d matrix(const std::vector<double>& dofs) const;
  /// Writes the angles of `rotation` into the three DoFs. Of all equivalent angles it takes those nearest to the
  /// present values, so that angles continue over full turns without jumps.
  void set_matrix(std::vector<double>& dofs, const Eigen::Matrix3d& rotation) const;
  Eigen::Vector3d position(const std::vector<double>& dofs) const;
  void set_position(std::vector<double>& dofs, const Eigen::Vector3d& position) const;

  const Skeleton::Root& root() const { return root_; }
  /// The joint whose frame takes the whole rotation; its origin is the centre of rotation.
  int joint() const { return joint_; }

 private:
  Skeleton::Root root_;
  int joint_ = 0;
  Eigen::Vector3d offset_ = Eigen::Vector3d::Zero();  ///< of the root's origin when all translations are 0
};

/// The rotation matrix of the rotation vector `turn`, radians (exponential map).
Eigen::Matrix3d rotation_of_vector(const Eigen::Vector3d& turn);
/// The rotation vector of a rotation matrix, at most pi long (logarithm): the inverse of `rotation_of_vector`.
Eigen::Vector3d vector_of_rotation(const Eigen::Matrix3d& rotation);
/// d log(exp(omega) exp(turn)) / d omega at omega = 0: how the rotation vector `turn` changes with a further rotation
/// omega after it,
///   1 - [t]/2 + (1/|t|^2 - (1 + cos|t|) / (2 |t| sin|t|)) [t]^2.
Eigen::Matrix3d step_derivative(const Eigen::Vector3d& turn);

}  // namespace doppel
