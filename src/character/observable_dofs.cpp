#include "doppel/character/observable_dofs.h"

#include <algorithm>
#include <cmath>

#include "doppel/character/landmarks.h"

namespace doppel {

namespace {

constexpr double kBend = 0.3, kStep = 0.01;  ///< radians or metres
constexpr double kMinLever = 0.01;           ///< metres per radian

/// The change of a DoF that turns a joint by a radian, or shifts it by a metre; 0 when it moves no joint.
double unit_of(const Skeleton& skeleton, const Dof& dof) {
  const double reach = dof_reach(skeleton, dof);
  return reach > 0.0 ? 1.0 / reach : 0.0;
}

/// How far a landmark moves at most, metres per radian or metre of a DoF. @param dofs [D]
double lever(const Skeleton& skeleton, const std::vector<Marker>& landmarks, std::vector<double> dofs, int dof) {
  const std::vector<Eigen::Vector3d> before = landmark_positions(skeleton, landmarks, dofs);
  dofs[dof] += kStep * unit_of(skeleton, skeleton.dofs[dof]);
  const std::vector<Eigen::Vector3d> after = landmark_positions(skeleton, landmarks, dofs);
  double most = 0.0;
  for (std::size_t m = 0; m < before.size(); ++m) most = std::max(most, (after[m] - before[m]).norm() / kStep);
  return most;
}

/// Per joint [J]: whether it or a joint above it turns.
std::vector<bool> turned_joints(const Skeleton& skeleton) {
  std::vector<bool> turned(skeleton.joints.size(), false);
  for (std::size_t j = 0; j < turned.size(); ++j) {
    const Joint& joint = skeleton.joints[j];
    turned[j] = joint.type == Joint::Type::revolute || (joint.parent >= 0 && turned[joint.parent]);
  }
  return turned;
}

/// Whether a DoF shifts a joint below one that turns. @param turned [J] of turned_joints
bool stretches_body(const Skeleton& skeleton, const Dof& dof, const std::vector<bool>& turned) {
  return std::any_of(dof.joints.begin(), dof.joints.end(), [&](const Dof::Drive& drive) {
    return drive.weight != 0.0 && skeleton.joints[drive.joint].type == Joint::Type::prismatic && turned[drive.joint];
  });
}

}  // namespace

double dof_reach(const Skeleton& skeleton, const Dof& dof) {
  double most = 0.0;
  for (const Dof::Drive& drive : dof.joints)
    most = std::max(most, std::abs(drive.weight) * skeleton.joints[drive.joint].axis.norm());
  return most;
}

std::vector<int> joint_angles(const Skeleton& skeleton) {
  const std::vector<bool> turned = turned_joints(skeleton);
  std::vector<int> dofs;
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    const Dof& dof = skeleton.dofs[d];
    const bool turns = std::any_of(dof.joints.begin(), dof.joints.end(), [&](const Dof::Drive& drive) {
      return drive.weight != 0.0 && skeleton.joints[drive.joint].type == Joint::Type::revolute;
    });
    if (turns && !stretches_body(skeleton, dof, turned)) dofs.push_back(d);
  }
  return dofs;
}

std::vector<int> observable_dofs(const Skeleton& skeleton, const std::vector<Marker>& landmarks) {
  std::vector<bool> carries(skeleton.joints.size(), false);
  for (const Marker& landmark : landmarks)
    for (int j = landmark.joint; j >= 0; j = skeleton.joints[j].parent) carries[j] = true;
  const std::vector<bool> turned = turned_joints(skeleton);
  std::vector<int> dofs;
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    const Dof& dof = skeleton.dofs[d];
    const bool moves = std::any_of(dof.joints.begin(), dof.joints.end(), [&](const Dof::Drive& drive) {
      return drive.weight != 0.0 && carries[drive.joint];
    });
    if (moves && !stretches_body(skeleton, dof, turned)) dofs.push_back(d);
  }
  return dofs;
}

std::vector<int> determined_dofs(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                                 const std::vector<double>& rest) {
  std::vector<double> bent = rest;
  const std::vector<int> observable = observable_dofs(skeleton, landmarks);
  for (const int dof : observable) bent[dof] += kBend * unit_of(skeleton, skeleton.dofs[dof]);
  std::vector<int> determined;
  for (const int dof : observable)
    if (std::max(lever(skeleton, landmarks, rest, dof), lever(skeleton, landmarks, bent, dof)) > kMinLever)
      determined.push_back(dof);
  return determined;
}

}  // namespace doppel
