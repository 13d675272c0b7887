#pragma once

/// Converts between the pose that a network predicts and the DoFs of a motion file: the choice of the predicted DoFs,
/// their units, and the root relative to the camera.
///
///   theta [B,P]   joint angles (radians; metres for sliding joints) of the chosen DoFs
///   alpha [B,3]   rotation of the root seen from the camera: R(alpha) = Ry(alpha_1) Rx(alpha_2) Rz(alpha_3)
///   t [B,3]       world position of the root's pivot
///
/// The heading is the outermost rotation of R(alpha), so a full turn of the person meets no singularity.

#include <torch/types.h>

#include <array>
#include <string>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// alpha of a person who stands upright and faces a level camera. The person has y up and looks along +z in the zero
/// pose; the camera's y axis points down.
inline constexpr std::array<double, 3> kUprightFacingCamera{0.0, 3.14159265358979323846, 0.0};

/// R(alpha), camera from root. @param alpha [...,3] @return [...,3,3]
torch::Tensor root_in_camera(const torch::Tensor& alpha);
/// The root's rotation in the world, R_c^T R(alpha). Equation: 5.1
/// @param alpha [B,3] @param camera_rotation [B,3,3] camera from world @return [B,3,3]
torch::Tensor root_in_world(const torch::Tensor& alpha, const torch::Tensor& camera_rotation);

/// The centre of the root's rotations when its translations are 0: the sum of the offsets down to the first rotation,
/// metres.
std::array<double, 3> root_pivot(const Skeleton& skeleton);

/// P chosen DoFs of a skeleton whose root is three translations followed by three rotations (Skeleton::root).
class PoseDofs {
 public:
  /// @param patterns names of DoFs ("left_*", "!*_toes"); `*` stands for any characters, and a leading `!` removes
  ///   matching DoFs from the choice so far; empty: all. Root DoFs and DoFs that drive no joint are never chosen.
  /// @param given [D] values of all other DoFs, e.g. the rest pose, in the file's units
  /// @throws UsageError naming a pattern that matches no DoF, or when no DoF is chosen; Error for another kind of root
  PoseDofs(const Skeleton& skeleton, const std::vector<std::string>& patterns, const std::vector<double>& given);

  int64_t size() const { return columns_.size(0); }  ///< P
  int64_t num_dofs() const { return given_.size(0); }
  const std::vector<std::string>& names() const { return names_; }  ///< [P]
  /// Limits of theta, float64 [P]; infinite where the skeleton states none.
  const torch::Tensor& lower() const { return lower_; }
  const torch::Tensor& upper() const { return upper_; }
  /// float64 [P]: the middle of the limits, or the given value of a DoF without limits.
  const torch::Tensor& middle() const { return middle_; }

  /// All DoFs, in the file's units. Differentiable in all three.
  /// @param theta [B,P] @param rotation [B,3,3] world from root @param position [B,3] of the pivot, world metres
  /// @return [B,D]; if the middle root rotation is at its pole (rotation_to_angles), the outermost is 0
  torch::Tensor dofs(const torch::Tensor& theta, const torch::Tensor& rotation, const torch::Tensor& position) const;
  /// As `dofs`, with the pivot at the origin and the root not rotated. @return [B,D]
  torch::Tensor root_relative(const torch::Tensor& theta) const;

  /// The inverse of `dofs`: theta, rotation and position.
  /// @param dofs [B,D]
  torch::Tensor theta(const torch::Tensor& dofs) const;     ///< [B,P]
  torch::Tensor rotation(const torch::Tensor& dofs) const;  ///< [B,3,3]
  torch::Tensor position(const torch::Tensor& dofs) const;  ///< [B,3]

 private:
  void choose(const Skeleton& skeleton, const std::vector<std::string>& patterns);
  torch::Tensor assemble(const torch::Tensor& theta, const torch::Tensor& root_values) const;

  Skeleton::Root root_;
  std::vector<std::string> names_;
  torch::Tensor columns_;                 ///< int64 [P] DoFs of theta
  torch::Tensor scale_;                   ///< float64 [P] radians or metres per unit of the DoF, > 0
  torch::Tensor lower_, upper_, middle_;  ///< float64 [P]
  torch::Tensor given_;                   ///< float64 [D]
  torch::Tensor root_columns_;            ///< int64 [6] translations x y z, rotations from the outermost
  torch::Tensor root_weight_;             ///< float64 [6]
  torch::Tensor pivot_;                   ///< float64 [3]
};

}  // namespace doppel
