// A stranger's program: a two-joint arm, posed by the installed package in double and through the tensor layer's
// conventions.
#include <doppel/character/skeleton.h>
#include <doppel/layers/embedded_deformation/embedded_deformation.h>

#include <cstdio>

int main() {
  doppel::Skeleton arm;
  arm.joints.push_back({"shoulder_rz", doppel::Joint::Type::revolute, -1, {0, 1.4, 0}, {0, 0, 1}});
  arm.joints.push_back({"hand", doppel::Joint::Type::revolute, 0, {0.6, 0, 0}, {0, 1, 0}});
  doppel::Dof lift;
  lift.name = "lift";
  lift.joints.push_back({0, 1.0});
  arm.dofs.push_back(lift);

  const Eigen::Vector3d hand = arm.pose({0.5})[1].translation();
  const torch::Tensor rotation = doppel::euler_to_matrix(torch::tensor({0.0, 0.0, 0.5}, torch::kFloat64));
  const double by_layer = 1.4 + 0.6 * rotation.index({1, 0}).item<double>();
  std::printf("the arm's end moved to (%.4f, %.4f, %.4f)\n", hand.x(), hand.y(), hand.z());
  return std::abs(hand.y() - by_layer) < 1e-9 ? 0 : 1;
}
