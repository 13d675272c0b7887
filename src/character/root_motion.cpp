#include "doppel/character/root_motion.h"

#include <cmath>

#include "doppel/core/angles.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr int kVertical = 1;

/// The angle of each rotation of the root, outermost first, radians.
std::array<double, 3> root_angles(const Skeleton::Root& root, const std::vector<double>& dofs) {
  std::array<double, 3> angles{};
  for (std::size_t i = 0; i < 3; ++i) angles[i] = root.rotation_weight[i] * dofs[root.rotation[i]];
  return angles;
}

Eigen::Matrix3d root_rotation(const Skeleton::Root& root, const std::vector<double>& dofs) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  const std::array<double, 3> angles = root_angles(root, dofs);
  for (std::size_t i = 0; i < 3; ++i)
    rotation = rotation * Eigen::AngleAxisd(angles[i], Eigen::Vector3d::Unit(root.axes[i]));
  return rotation;
}

/// The part of a rotation that is about the vertical, radians (swing and twist).
double turn_about_vertical(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return std::remainder(2.0 * std::atan2(q.y(), q.w()), 2.0 * kPi);
}

Eigen::Vector2d turned_on_ground(double turn, const Eigen::Vector2d& at) {
  const double c = std::cos(turn), s = std::sin(turn);
  return {c * at.x() + s * at.y(), -s * at.x() + c * at.y()};
}

void set_ground_position(const Skeleton::Root& root, const Eigen::Vector2d& at, std::vector<double>& dofs) {
  dofs[root.translation[0]] = at.x() / root.translation_weight[0];
  dofs[root.translation[2]] = at.y() / root.translation_weight[2];
}

/// Of the two triples of angles with one rotation, the one nearer to `like`, up to full turns. @param first one of them
std::array<double, 3> nearest_angles(const Eigen::Vector3d& first, const std::array<double, 3>& like) {
  std::array<double, 3> nearest{};
  double least = HUGE_VAL;
  for (const Eigen::Vector3d& angles : {first, Eigen::Vector3d(first[0] + kPi, kPi - first[1], first[2] + kPi)}) {
    std::array<double, 3> found{};
    double distance = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double change = std::remainder(angles[static_cast<Eigen::Index>(i)] - like[i], 2.0 * kPi);
      found[i] = like[i] + change;
      distance += std::abs(change);
    }
    if (distance >= least) continue;
    least = distance;
    nearest = found;
  }
  return nearest;
}

}  // namespace

std::optional<Skeleton::Root> root_that_travels(const Skeleton& skeleton) {
  try {
    return skeleton.root();
  } catch (const Error&) {
    return std::nullopt;
  }
}

Eigen::Vector2d ground_position(const Skeleton::Root& root, const std::vector<double>& dofs) {
  return {root.translation_weight[0] * dofs[root.translation[0]],
          root.translation_weight[2] * dofs[root.translation[2]]};
}

GroundStep ground_step(const Skeleton::Root& root, const Motion& motion, int first, int later, int count) {
  GroundStep step;
  Eigen::Vector2d direction = Eigen::Vector2d::Zero();  // sum of the turns as points of the unit circle
  for (int t = 0; t < count; ++t) {
    const std::vector<double>&before = motion.frames[first + t], &after = motion.frames[later + t];
    const double turn = turn_about_vertical(root_rotation(root, after) * root_rotation(root, before).transpose());
    direction += Eigen::Vector2d(std::cos(turn), std::sin(turn));
    step.from += ground_position(root, before) / count;
    step.to += ground_position(root, after) / count;
  }
  step.turn = std::atan2(direction.y(), direction.x());
  return step;
}

std::vector<double> before_step(const Skeleton::Root& root, std::vector<double> dofs, const GroundStep& step,
                                const std::vector<double>& like) {
  set_ground_position(root, step.from + turned_on_ground(-step.turn, ground_position(root, dofs) - step.to), dofs);
  const std::array<double, 3> now = root_angles(root, dofs);
  Eigen::Vector3d back(now[0] - step.turn, now[1], now[2]);
  if (root.axes[0] != kVertical) {
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(-step.turn, Eigen::Vector3d::Unit(kVertical)) * root_rotation(root, dofs);
    back = rotation.eulerAngles(root.axes[0], root.axes[1], root.axes[2]);
  }
  const std::array<double, 3> angles = nearest_angles(back, root_angles(root, like));
  for (std::size_t i = 0; i < 3; ++i) dofs[root.rotation[i]] = angles[i] / root.rotation_weight[i];
  return dofs;
}

Motion in_place(const Skeleton::Root& root, Motion motion) {
  if (motion.frames.empty()) return motion;
  const Eigen::Vector2d at = ground_position(root, motion.frames[0]);
  for (std::vector<double>& dofs : motion.frames) set_ground_position(root, at, dofs);
  return motion;
}

}  // namespace doppel
