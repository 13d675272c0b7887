// The pose of an arm from the keypoints of its joints in two cameras.
#include <doppel/layers/kinematics/kinematics.h>

#include <cstdio>

#include "sphere.h"

/// Shoulder with two axes, elbow with one, and three markers.
doppel::Skeleton make_arm() {
  using doppel::Joint;
  doppel::Skeleton arm;
  arm.joints.push_back({"shoulder_rz", Joint::Type::revolute, -1, {0, 0, 0}, {0, 0, 1}});
  arm.joints.push_back({"shoulder_ry", Joint::Type::revolute, 0, {0, 0, 0}, {0, 1, 0}});
  arm.joints.push_back({"elbow_ry", Joint::Type::revolute, 1, {0.5, 0, 0}, {0, 1, 0}});
  for (int joint = 0; joint < 3; ++joint) {
    doppel::Dof dof;
    dof.name = arm.joints[static_cast<std::size_t>(joint)].name;
    dof.joints.push_back({joint, 1.0});
    arm.dofs.push_back(dof);
  }
  arm.markers = {{"shoulder", 1, {0, 0, 0}}, {"elbow", 2, {0, 0, 0}}, {"hand", 2, {0.5, 0, 0}}};
  return arm;
}

int main() {
  const doppel::Skeleton arm = make_arm();
  const doppel::KinematicChain chain(arm);
  const doppel::RiddenFrames markers = doppel::marker_frames(arm, arm.markers);
  const torch::Tensor cameras = make_cameras(3, 200)[0].slice(0, 0, 2);  // [2,3,4]
  const auto keypoints = [&](const torch::Tensor& dofs) {                // [2,3,2] pixels
    const torch::Tensor points = doppel::forward_kinematics(dofs, chain, markers)[0].select(-1, 3);
    const torch::Tensor seen = torch::matmul(cameras.slice(2, 0, 3), points.t()) + cameras.slice(2, 3, 4);
    return (seen.slice(1, 0, 2) / seen.slice(1, 2, 3)).transpose(1, 2);
  };
  const torch::Tensor ground_truth = torch::tensor({{0.7f, -0.4f, -0.9f}}), target = keypoints(ground_truth);

  const torch::Tensor dofs = torch::zeros({1, 3}).requires_grad_();
  torch::optim::Adam optimiser({dofs}, 0.05);
  for (int step = 0; step < 300; ++step) {
    optimiser.zero_grad();
    (keypoints(dofs) - target).square().mean().backward();
    optimiser.step();
  }
  const double off = (dofs - ground_truth).abs().max().item<double>();
  std::printf("the pose is off by %.5f radians at most\n", off);
  return off < 1e-2 ? 0 : 1;
}
