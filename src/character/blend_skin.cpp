#include "doppel/character/blend_skin.h"

#include <utility>

#include "doppel/core/as_size.h"

namespace doppel {

using Eigen::Quaterniond;
using Eigen::Vector3d;

std::vector<Eigen::Affine3d> bone_motions(const Character& character, const std::vector<double>& dofs) {
  const auto rest = character.skeleton.pose(character.rest_dofs), posed = character.skeleton.pose(dofs);
  std::vector<Eigen::Affine3d> motions;
  for (const int joint : character.bone_joint) motions.push_back(posed[joint] * rest[joint].inverse(Eigen::Isometry));
  return motions;
}

SkinBlend::SkinBlend(std::vector<Eigen::Affine3d> motions, SkinningMode mode)
    : motions_(std::move(motions)), mode_(mode) {
  if (mode_ == SkinningMode::linear) return;
  for (const Eigen::Affine3d& motion : motions_) {
    real_.emplace_back(Eigen::Matrix3d(motion.linear()));
    const Vector3d half = 0.5 * motion.translation();
    dual_.push_back(Quaterniond(0.0, half.x(), half.y(), half.z()) * real_.back());
  }
}

Vector3d SkinBlend::point(const Vector3d& rest, std::span<const int> bones, std::span<const double> weights) const {
  if (mode_ == SkinningMode::linear) {
    Vector3d sum = Vector3d::Zero();
    for (std::size_t i = 0; i < bones.size(); ++i) sum += weights[i] * (motions_[bones[i]] * rest);
    return sum;
  }
  const Quaterniond& pivot = real_[bones[0]];
  Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
  for (std::size_t i = 0; i < bones.size(); ++i) {
    const std::size_t b = as_size(bones[i]);
    const double weight = real_[b].dot(pivot) < 0.0 ? -weights[i] : weights[i];
    real += weight * real_[b].coeffs();
    dual += weight * dual_[b].coeffs();
  }
  const Quaterniond turn(Eigen::Vector4d(real / real.norm())), move(Eigen::Vector4d(dual / real.norm()));
  return turn * rest + 2.0 * (move * turn.conjugate()).vec();
}

std::vector<Vector3d> SkinBlend::vertices(const std::vector<Vector3d>& rest, const SkinningWeights& skin) const {
  std::vector<Vector3d> posed;
  posed.reserve(rest.size());
  for (int v = 0; v < skin.num_vertices(); ++v)
    posed.push_back(point(rest[v], skin.vertex_bones.row(v), skin.vertex_bones.row_of(skin.weights, v)));
  return posed;
}

std::vector<Vector3d> posed_vertices(const Character& character, const std::vector<double>& dofs) {
  return SkinBlend(bone_motions(character, dofs), character.skinning).vertices(character.mesh.vertices, character.skin);
}

}  // namespace doppel
