#include "doppel/track/energy/root_rotation.h"

#include <array>
#include <cmath>
#include <limits>

#include "doppel/core/error.h"

namespace doppel {
namespace {

/// The angle nearest to `near` that differs from `angle` by whole turns.
double unwrapped(double angle, double near) { return angle + 2.0 * M_PI * std::round((near - angle) / (2.0 * M_PI)); }

/// The number of DoFs that drive a joint.
int drives_of(const Skeleton& skeleton, int joint) {
  int count = 0;
  for (const Dof& dof : skeleton.dofs)
    for (const Dof::Drive& drive : dof.joints) count += drive.joint == joint && drive.weight != 0.0;
  return count;
}

int only_joint(const Dof& dof) { return dof.joints.size() == 1 ? dof.joints.front().joint : -1; }

bool turns_about_one_point(const Skeleton& skeleton, const Skeleton::Root& root) {
  for (int i = 0; i < 3; ++i) {
    const int moved = only_joint(skeleton.dofs[root.translation[i]]);
    const int turned = only_joint(skeleton.dofs[root.rotation[i]]);
    if (moved < 0 || turned < 0 || drives_of(skeleton, moved) != 1 || drives_of(skeleton, turned) != 1) return false;
    if (i > 0 && !skeleton.joints[turned].offset.isZero()) return false;
  }
  return true;
}

}  // namespace

Eigen::Matrix3d rotation_of_vector(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle < 1e-300) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

Eigen::Vector3d vector_of_rotation(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d step_derivative(const Eigen::Vector3d& turn) {
  constexpr double kSmall = 1e-4;  // below, the factor of the square is 1/12 to all digits
  const double angle = turn.norm();
  Eigen::Matrix3d cross;
  cross << 0.0, -turn.z(), turn.y(), turn.z(), 0.0, -turn.x(), -turn.y(), turn.x(), 0.0;
  const double square =
      angle < kSmall ? 1.0 / 12.0 : 1.0 / (angle * angle) - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle));
  return Eigen::Matrix3d::Identity() - 0.5 * cross + square * cross * cross;
}

std::optional<RootRotation> RootRotation::of(const Skeleton& skeleton) {
  RootRotation result;
  try {
    result.root_ = skeleton.root();
  } catch (const Error&) {
    return std::nullopt;
  }
  if (!turns_about_one_point(skeleton, result.root_)) return std::nullopt;
  result.joint_ = only_joint(skeleton.dofs[result.root_.rotation[2]]);
  std::vector<double> dofs(skeleton.dofs.size(), 0.0);
  result.offset_ = skeleton.pose(dofs)[result.joint_].translation();
  return result;
}

Eigen::Matrix3d RootRotation::matrix(const std::vector<double>& dofs) const {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i)
    rotation = rotation * Eigen::AngleAxisd(root_.rotation_weight[i] * dofs[root_.rotation[i]],
                                            Eigen::Vector3d::Unit(root_.axes[i]));
  return rotation;
}

void RootRotation::set_matrix(std::vector<double>& dofs, const Eigen::Matrix3d& rotation) const {
  std::array<double, 3> before{};
  for (int i = 0; i < 3; ++i) before[i] = root_.rotation_weight[i] * dofs[root_.rotation[i]];
  const Eigen::Vector3d first = rotation.eulerAngles(root_.axes[0], root_.axes[1], root_.axes[2]);
  const Eigen::Vector3d second(first[0] + M_PI, M_PI - first[1], first[2] + M_PI);
  double nearest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& angles : {first, second}) {
    Eigen::Vector3d near;
    double distance = 0.0;
    for (int i = 0; i < 3; ++i) {
      near[i] = unwrapped(angles[i], before[i]);
      distance += std::pow(near[i] - before[i], 2);
    }
    if (distance >= nearest) continue;
    nearest = distance;
    for (int i = 0; i < 3; ++i) dofs[root_.rotation[i]] = near[i] / root_.rotation_weight[i];
  }
}

Eigen::Vector3d RootRotation::position(const std::vector<double>& dofs) const {
  Eigen::Vector3d position = offset_;
  for (int i = 0; i < 3; ++i) position[i] += root_.translation_weight[i] * dofs[root_.translation[i]];
  return position;
}

void RootRotation::set_position(std::vector<double>& dofs, const Eigen::Vector3d& position) const {
  for (int i = 0; i < 3; ++i) dofs[root_.translation[i]] = (position[i] - offset_[i]) / root_.translation_weight[i];
}

}  // namespace doppel
