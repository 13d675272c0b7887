#include "doppel/character/observable_dofs.h"

#include <algorithm>
#include <cmath>

#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"

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

}  // namespace

double dof_reach(const Skeleton& skeleton, const Dof& dof) {
  double most = 0.0;
  for (const Dof::Drive& drive : dof.joints)
    most = std::max(most, std::abs(drive.weight) * skeleton.joints[drive.joint].axis.norm());
  return most;
}

std::vector<int> observable_dofs(const Skeleton& skeleton, const std::vector<Marker>& landmarks) {
  std::vector<bool> carries(skeleton.joints.size(), false), turned(skeleton.joints.size(), false);
  for (const Marker& landmark : landmarks)
    for (int j = landmark.joint; j >= 0; j = skeleton.joints[j].parent) carries[j] = true;
  for (std::size_t j = 0; j < turned.size(); ++j) {
    const Joint& joint = skeleton.joints[j];
    turned[j] = joint.type == Joint::Type::revolute || (joint.parent >= 0 && turned[joint.parent]);
  }
  std::vector<int> dofs;
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    bool moves = false, stretches = false;
    for (const Dof::Drive& drive : skeleton.dofs[d].joints) {
      if (drive.weight == 0.0) continue;
      const auto j = as_size(drive.joint);
      stretches = stretches || (skeleton.joints[j].type == Joint::Type::prismatic && turned[j]);
      moves = moves || carries[j];
    }
    if (moves && !stretches) dofs.push_back(d);
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
