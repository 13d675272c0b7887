#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// The motion of each bone from the rest pose to another pose: [Bn] posed from rest, rigid, world metres.
/// @param dofs [D]
std::vector<Eigen::Affine3d> bone_motions(const Character& character, const std::vector<double>& dofs);

/// Skinning in double precision without LibTorch (equations: layers/skinning/skinning.h). Poses points by blending the
/// motions of bones.
class SkinBlend {
 public:
  /// @param motions [Bn] rigid, as from bone_motions
  SkinBlend(std::vector<Eigen::Affine3d> motions, SkinningMode mode);

  /// @param rest world metres @param bones at least one; the first fixes the signs of dual quaternions
  /// @param weights one for each bone, of sum 1
  Eigen::Vector3d point(const Eigen::Vector3d& rest, std::span<const int> bones, std::span<const double> weights) const;

  /// All vertices of a template in the pose [N].
  std::vector<Eigen::Vector3d> vertices(const std::vector<Eigen::Vector3d>& rest, const SkinningWeights& skin) const;

  const std::vector<Eigen::Affine3d>& motions() const { return motions_; }

 private:
  std::vector<Eigen::Affine3d> motions_;
  SkinningMode mode_;
  std::vector<Eigen::Quaterniond> real_, dual_;  ///< [Bn] the motions as dual quaternions; empty in linear mode
};

/// The template of a character in a pose [N], world metres. @param dofs [D]
std::vector<Eigen::Vector3d> posed_vertices(const Character& character, const std::vector<double>& dofs);

}  // namespace doppel
