#pragma once

/// The pose as a network predicts it, and the DoFs of a motion file: which DoFs are predicted, in which units, and
/// where the camera-relative root goes.
///
///   theta [B,P]   joint angles (radians; metres for sliding joints) of the chosen DoFs
///   alpha [B,3]   rotation of the root seen from the camera: R(alpha) = Ry(alpha_1) Rx(alpha_2) Rz(alpha_3)
///   t [B,3]       world position of the root's pivot
///
/// The heading comes first in R(alpha), so that a person may turn all the way round without a singularity.

#include <torch/torch.h>

#include <array>
#include <string>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// alpha of a person who stands upright (y up, looking along +z in the zero pose) and faces a level camera, whose y
/// points down.
inline constexpr std::array<double, 3> kUprightFacingCamera{0.0, 3.14159265358979323846, 0.0};

/// R(alpha), camera from root. @param alpha [...,3] @return [...,3,3]
torch::Tensor root_in_camera(const torch::Tensor& alpha);
/// The root's rotation in the world, R_c^T R(alpha). Equation: 5.1
/// @param alpha [B,3] @param camera_rotation [B,3,3] camera from world @return [B,3,3]
torch::Tensor root_in_world(const torch::Tensor& alpha, const torch::Tensor& camera_rotation);

/// Where the root's rotations turn when its translations are 0: the sum of offsets down to the first of them, metres.
std::array<double, 3> root_pivot(const Skeleton& skeleton);

/// P chosen DoFs of a skeleton whose root is three translations followed by three rotations (Skeleton::root).
class PoseDofs {
 public:
  /// @param patterns names of DoFs; `*` stands for any characters, a leading `!` takes out what was chosen so far
  /// ("left_*", "!*_toes"); empty: all. Root DoFs and those that drive nothing are never among them.
  /// @param given [D] values of all other DoFs, e.g. the rest pose, in the file's units
  /// @throws UsageError naming a pattern that fits no DoF, or when none is left; Error for another kind of root
  PoseDofs(const Skeleton& skeleton, const std::vector<std::string>& patterns, const std::vector<double>& given);

  int64_t size() const { return columns_.size(0); }  ///< P
  int64_t num_dofs() const { return given_.size(0); }
  const std::vector<std::string>& names() const { return names_; }  ///< [P]
  /// Limits of theta, float64 [P]; infinite where the skeleton states none.
  const torch::Tensor& lower() const { return lower_; }
  const torch::Tensor& upper() const { return upper_; }
  /// float64 [P]: the middle of the limits; the given value where there are none.
  const torch::Tensor& middle() const { return middle_; }

  /// All DoFs, in the file's units. Differentiable in all three.
  /// @param theta [B,P] @param rotation [B,3,3] world from root @param position [B,3] of the pivot, world metres
  /// @return [B,D]; where the middle root rotation is at its pole (rotation_to_angles) the outermost is 0
  torch::Tensor dofs(const torch::Tensor& theta, const torch::Tensor& rotation, const torch::Tensor& position) const;
  /// The same with the pivot at the origin and the root not turned. @return [B,D]
  torch::Tensor root_relative(const torch::Tensor& theta) const;

  /// The other way round: what `dofs` was made of.
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
