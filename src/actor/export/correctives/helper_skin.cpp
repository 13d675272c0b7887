#include "doppel/actor/export/correctives/helper_skin.h"

#include "doppel/core/as_size.h"
#include "doppel/geometry/best_rotation.h"

namespace doppel {
namespace {

constexpr int kTurns = 6;
constexpr double kPull = 0.01;      ///< weight of the mean, where that of the surface is 1
constexpr double kSteady = 1e-8;    ///< square metres: a helper of one vertex, or of a line of them, keeps its rotation
constexpr double kMinReach = 1e-6;  ///< a helper with less moves nothing, and stays at its mean

}  // namespace

HelperPoser::HelperPoser(const HelperSkin& skin) : skin_(skin), parts_(skin.parents.size()) {
  for (std::size_t v = 0; v < skin.skin.rest.size(); ++v)
    for (std::size_t i = 0; i < 4; ++i) {
      const int helper = skin.skin.joint[v][i] - skin.bones;
      const double weight = static_cast<double>(skin.skin.weight[v][i]);
      if (helper < 0 || weight <= 0.0) continue;
      Part& part = parts_[as_size(helper)];
      part.members.push_back({v, weight});
      part.squares += weight * weight;
      part.centre += weight * weight * skin.skin.rest[v];
    }
  for (Part& part : parts_) {
    if (part.squares > 0.0) part.centre /= part.squares;
    for (const Member& member : part.members) {
      const Eigen::Vector3d arm = skin.skin.rest[member.vertex] - part.centre;
      part.spread += member.weight * member.weight * arm * arm.transpose();
    }
    part.spread += kSteady * part.squares * Eigen::Matrix3d::Identity();
  }
}

std::vector<Eigen::Affine3d> HelperPoser::at_mean(const std::vector<Eigen::Affine3d>& bones) const {
  std::vector<Eigen::Affine3d> helpers;
  for (std::size_t h = 0; h < parts_.size(); ++h) helpers.push_back(bones[as_size(skin_.parents[h])] * skin_.mean[h]);
  return helpers;
}

/// Procrustes for the vertices that are left plus what the helper itself did, and with a small weight for its mean.
/// Both are sums over the rest vertices of a helper, of which its spread is all that is needed.
Eigen::Affine3d HelperPoser::nearest(const Part& part, const Eigen::Matrix3Xd& left, const Eigen::Affine3d& before,
                                     const Eigen::Affine3d& mean) const {
  if (part.squares < kMinReach) return mean;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (const Member& member : part.members) {
    const Eigen::Vector3d weighted = member.weight * left.col(static_cast<Eigen::Index>(member.vertex));
    sum += weighted;
    moment += weighted * (skin_.skin.rest[member.vertex] - part.centre).transpose();
  }
  Eigen::Affine3d found = Eigen::Affine3d::Identity();
  found.linear() = nearest_rotation((before.linear() + kPull * mean.linear()) * part.spread + moment);
  const Eigen::Vector3d target =
      (before * part.centre + sum / part.squares + kPull * (mean * part.centre)) / (1.0 + kPull);
  found.translation() = target - found.linear() * part.centre;
  return found;
}

void HelperPoser::turn(const std::vector<Eigen::Affine3d>& means, Eigen::Matrix3Xd& left,
                       std::vector<Eigen::Affine3d>& helpers) const {
  for (std::size_t h = 0; h < parts_.size(); ++h) {
    const Eigen::Affine3d found = nearest(parts_[h], left, helpers[h], means[h]);
    for (const Member& member : parts_[h].members) {
      const Eigen::Vector3d& rest = skin_.skin.rest[member.vertex];
      left.col(static_cast<Eigen::Index>(member.vertex)) += member.weight * (helpers[h] * rest - found * rest);
    }
    helpers[h] = found;
  }
}

std::vector<Eigen::Affine3d> HelperPoser::pose(const std::vector<Eigen::Affine3d>& bones,
                                               const Eigen::Matrix3Xd& vertices) const {
  const std::vector<Eigen::Affine3d> means = at_mean(bones);
  std::vector<Eigen::Affine3d> helpers = means;
  Eigen::Matrix3Xd left = left_by(skin_.skin, all_joints(bones, helpers), vertices);
  for (int i = 0; i < kTurns; ++i) turn(means, left, helpers);
  return helpers;
}

void HelperPoser::improve(const std::vector<Eigen::Affine3d>& bones, const Eigen::Matrix3Xd& vertices,
                          std::vector<Eigen::Affine3d>& helpers) const {
  Eigen::Matrix3Xd left = left_by(skin_.skin, all_joints(bones, helpers), vertices);
  turn(at_mean(bones), left, helpers);
}

Eigen::Matrix3Xd left_by(const LinearSkin& skin, const std::vector<Eigen::Affine3d>& joints,
                         Eigen::Matrix3Xd vertices) {
  for (std::size_t v = 0; v < skin.rest.size(); ++v)
    for (std::size_t i = 0; i < 4; ++i)
      if (skin.weight[v][i] > 0.0F)
        vertices.col(static_cast<Eigen::Index>(v)) -=
            static_cast<double>(skin.weight[v][i]) * (joints[as_size(skin.joint[v][i])] * skin.rest[v]);
  return vertices;
}

std::vector<Eigen::Affine3d> all_joints(std::vector<Eigen::Affine3d> bones,
                                        const std::vector<Eigen::Affine3d>& helpers) {
  bones.insert(bones.end(), helpers.begin(), helpers.end());
  return bones;
}

}  // namespace doppel
