#include "doppel/layers/kinematics/kinematics.h"

#include <algorithm>

#include "doppel/core/error.h"

namespace doppel {
namespace {

torch::Tensor to_tensor(const Eigen::Affine3d& transform) {
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = transform.matrix().topRows<3>();
  return torch::from_blob(const_cast<double*>(rows.data()), {3, 4}, torch::kFloat64).clone();
}

RiddenFrames make_frames(const std::vector<int>& joints, const std::vector<Eigen::Affine3d>& locals) {
  RiddenFrames frames;
  frames.joint = torch::empty({static_cast<int64_t>(joints.size())}, torch::kInt32);
  frames.local = torch::empty({static_cast<int64_t>(joints.size()), 3, 4}, torch::kFloat64);
  for (size_t m = 0; m < joints.size(); ++m) {
    frames.joint[m] = joints[m];
    frames.local[m] = to_tensor(locals[m]);
  }
  return frames;
}

RiddenFrames frames_of_joints(const Skeleton& skeleton) {
  std::vector<int> joints(skeleton.num_joints());
  for (int j = 0; j < skeleton.num_joints(); ++j) joints[j] = j;
  return make_frames(joints, std::vector<Eigen::Affine3d>(joints.size(), Eigen::Affine3d::Identity()));
}

RiddenFrames frames_of_bones(const Character& character) {
  const std::vector<Eigen::Affine3d> rest = character.skeleton.pose(character.rest_dofs);
  std::vector<Eigen::Affine3d> locals;
  for (int joint : character.bone_joint) locals.push_back(rest.at(joint).inverse(Eigen::Isometry));
  return make_frames(character.bone_joint, locals);
}

}  // namespace

RiddenFrames marker_frames(const Skeleton& skeleton, const std::vector<Marker>& markers) {
  std::vector<int> joints;
  std::vector<Eigen::Affine3d> locals;
  for (const Marker& marker : markers) {
    if (marker.joint < 0 || marker.joint >= skeleton.num_joints())
      fail<UsageError>("landmark '{}' rides on joint {}; the skeleton has {}", marker.name, marker.joint,
                       skeleton.num_joints());
    joints.push_back(marker.joint);
    locals.emplace_back(Eigen::Translation3d(marker.position));
  }
  return make_frames(joints, locals);
}

KinematicChain::KinematicChain(const Skeleton& skeleton)
    : num_joints(skeleton.num_joints()), num_dofs(skeleton.num_dofs()) {
  const int64_t J = num_joints;
  std::vector<int> parents(J + 1, static_cast<int>(J)), first(J + 1, 0);
  parent = torch::empty({J}, torch::kInt32);
  prismatic = torch::empty({J}, torch::kInt32);
  geometry = torch::zeros({J, 6}, torch::kFloat64);
  weights = torch::zeros({num_dofs, J + 1}, torch::kFloat64);
  skew = torch::zeros({J + 1, 3, 3}, torch::kFloat64);
  offset = torch::zeros({J + 1, 3}, torch::kFloat64);
  slide = torch::zeros({J + 1, 3}, torch::kFloat64);
  auto weight = weights.accessor<double, 2>();
  for (int64_t d = 0; d < num_dofs; ++d) {
    for (const Dof::Drive& drive : skeleton.dofs[d].joints) weight[d][drive.joint] += drive.weight;
  }
  std::vector<int> dofs_of_drive;
  std::vector<double> weight_of_drive;
  auto rows = geometry.accessor<double, 2>();
  auto cross = skew.accessor<double, 3>();
  for (int64_t j = 0; j < J; ++j) {
    const Joint& joint = skeleton.joints[j];
    if (joint.parent >= j)
      fail("joint {} comes before its parent {}; read_skeleton reorders them", joint.name, joint.parent);
    const bool slides = joint.type == Joint::Type::prismatic;
    parent[j] = joint.parent;
    prismatic[j] = slides ? 1 : 0;
    if (joint.parent >= 0) parents[j] = joint.parent;
    for (int c = 0; c < 3; ++c) {
      rows[j][c] = joint.offset[c];
      rows[j][3 + c] = joint.axis[c];
      offset[j][c] = joint.offset[c];
      if (slides) slide[j][c] = joint.axis[c];
      // [axis]x: the entry in row c+2 and column c+1 is +axis_c, its transpose is -axis_c.
      if (!slides) {
        cross[j][(c + 2) % 3][(c + 1) % 3] = joint.axis[c];
        cross[j][(c + 1) % 3][(c + 2) % 3] = -joint.axis[c];
      }
    }
    for (int64_t d = 0; d < num_dofs; ++d) {
      if (weight[d][j] == 0.0) continue;
      dofs_of_drive.push_back(static_cast<int>(d));
      weight_of_drive.push_back(weight[d][j]);
    }
    first[j + 1] = static_cast<int>(dofs_of_drive.size());
  }
  skew_squared = torch::matmul(skew, skew);
  drive_offsets = torch::tensor(first, torch::kInt32);
  drive_dof = torch::tensor(dofs_of_drive, torch::kInt32);
  drive_weight = torch::tensor(weight_of_drive, torch::kFloat64);

  while (std::any_of(parents.begin(), parents.end(), [&](int p) { return p != J; })) {
    ancestors.push_back(torch::tensor(parents, torch::kInt64));
    std::vector<int> doubled(parents.size());
    for (size_t j = 0; j < parents.size(); ++j) doubled[j] = parents[parents[j]];
    parents = doubled;
  }
}

KinematicsImpl::KinematicsImpl(const Character& character)
    : torch::nn::Module("Kinematics"),
      chain_(character.skeleton),
      joint_frames_(frames_of_joints(character.skeleton)),
      bone_frames_(frames_of_bones(character)),
      marker_frames_(marker_frames(character.skeleton, character.skeleton.markers)) {}

torch::Tensor KinematicsImpl::joints(const torch::Tensor& dofs) const {
  return forward_kinematics(dofs, chain_, joint_frames_);
}

torch::Tensor KinematicsImpl::bones(const torch::Tensor& dofs) const {
  return forward_kinematics(dofs, chain_, bone_frames_);
}

torch::Tensor KinematicsImpl::markers(const torch::Tensor& dofs) const {
  return forward_kinematics(dofs, chain_, marker_frames_).select(-1, 3);
}

void KinematicsImpl::pretty_print(std::ostream& stream) const {
  stream << "Kinematics(dofs=" << chain_.num_dofs << ", joints=" << chain_.num_joints
         << ", bones=" << bone_frames_.joint.size(0) << ", markers=" << marker_frames_.joint.size(0) << ")";
}

}  // namespace doppel
