#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/geometry/mesh.h"

namespace doppel::support {

using Motions = std::vector<Eigen::Affine3d>;  ///< [Bn] posed_from_rest of each bone

inline std::vector<Eigen::Vector3d> blend_linear(const std::vector<Eigen::Vector3d>& rest, const SkinningWeights& skin,
                                                 const Motions& motions) {
  std::vector<Eigen::Vector3d> posed(rest.size(), Eigen::Vector3d::Zero());
  for (int v = 0; v < skin.num_vertices(); ++v)
    for (int k = skin.vertex_bones.offsets[v]; k < skin.vertex_bones.offsets[v + 1]; ++k)
      posed[v] += skin.weights[k] * (motions[skin.vertex_bones.items[k]] * rest[v]);
  return posed;
}

/// Dual quaternions (Kavan et al. 2008).
inline std::vector<Eigen::Vector3d> blend_dual_quaternions(const std::vector<Eigen::Vector3d>& rest,
                                                           const SkinningWeights& skin, const Motions& motions) {
  std::vector<Eigen::Quaterniond> turns;
  std::vector<Eigen::Quaterniond> moves;
  for (const Eigen::Affine3d& motion : motions) {
    turns.emplace_back(motion.rotation());
    const Eigen::Vector3d half = 0.5 * motion.translation();
    moves.push_back(Eigen::Quaterniond(0, half.x(), half.y(), half.z()) * turns.back());
  }
  std::vector<Eigen::Vector3d> posed;
  for (int v = 0; v < skin.num_vertices(); ++v) {
    Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
    const auto& pivot = turns[skin.vertex_bones.row(v).front()];
    for (int k = skin.vertex_bones.offsets[v]; k < skin.vertex_bones.offsets[v + 1]; ++k) {
      const int bone = skin.vertex_bones.items[k];
      const double weight = turns[bone].dot(pivot) < 0 ? -skin.weights[k] : skin.weights[k];
      real += weight * turns[bone].coeffs();
      dual += weight * moves[bone].coeffs();
    }
    const double length = real.norm();
    const Eigen::Quaterniond turn(Eigen::Vector4d(real / length)), move(Eigen::Vector4d(dual / length));
    posed.push_back(turn * rest[v] + 2.0 * (move * turn.conjugate()).vec());
  }
  return posed;
}

/// The signed volume of a closed mesh.
inline double volume(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& faces) {
  double sum = 0;
  for (const Triangle& f : faces) sum += vertices[f[0]].dot(vertices[f[1]].cross(vertices[f[2]])) / 6;
  return sum;
}

/// The largest stretch of a triangle: the larger singular value of the map from its rest shape. Triangles that are
/// nearly a line at rest count as 1.
inline double stretch(const std::array<Eigen::Vector3d, 3>& rest, const std::array<Eigen::Vector3d, 3>& posed) {
  Eigen::Matrix<double, 3, 2> a, b;
  a << rest[1] - rest[0], rest[2] - rest[0];
  b << posed[1] - posed[0], posed[2] - posed[0];
  const Eigen::Vector3d u = a.col(0).normalized(), n = a.col(0).cross(a.col(1));
  if (n.norm() < 0.02 * a.squaredNorm()) return 1.0;
  const Eigen::Vector3d v = n.cross(u).normalized();
  Eigen::Matrix2d flat;
  flat << u.dot(a.col(0)), u.dot(a.col(1)), v.dot(a.col(0)), v.dot(a.col(1));
  return Eigen::JacobiSVD<Eigen::MatrixXd>(b * flat.inverse()).singularValues()[0];
}

}  // namespace doppel::support
