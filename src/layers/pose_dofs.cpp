#include "doppel/layers/pose_dofs.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/character/dof_names.h"
#include "doppel/character/observable_dofs.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/rotation_math.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr std::array<int, 3> kCameraAxes{1, 0, 2};

Tensor doubles(const std::vector<double>& values) { return torch::tensor(values, torch::kFloat64); }

/// Repeats a row [n] for each sample of `like` [B,...] without reading B, which a trace would record as a constant.
Tensor per_sample(const Tensor& row, const Tensor& like) {
  return torch::zeros_like(like.narrow(1, 0, 1)) + constant_like(row, like);
}

/// The root's rotations and translations can be separated only if all rotations have the same centre.
void check_pivot(const Skeleton& skeleton, const Skeleton::Root& root, const Eigen::Vector3d& pivot) {
  std::vector<double> turned(skeleton.dofs.size(), 0.0);
  for (int dof : root.rotation) turned[dof] = 1.0;
  const int last = skeleton.dofs[root.rotation[2]].joints.front().joint;
  const double off = (skeleton.pose(turned)[last].translation() - pivot).norm();
  if (off > 1e-9)
    fail("the rotations of the skeleton's root do not turn about one point: joint '{}' is moved by {:.3f} m",
         skeleton.joints[last].name, off);
}

}  // namespace

Tensor root_in_camera(const Tensor& alpha) { return angles_to_rotation(alpha, kCameraAxes); }

Tensor root_in_world(const Tensor& alpha, const Tensor& camera_rotation) {
  check_shape("root_in_world", "alpha", alpha, {-1, 3}, "[B,3]");
  check_shape("root_in_world", "camera_rotation", camera_rotation, {alpha.size(0), 3, 3}, "[B,3,3]");
  return torch::matmul(camera_rotation.transpose(-2, -1), root_in_camera(alpha));
}

std::array<double, 3> root_pivot(const Skeleton& skeleton) {
  int joint = skeleton.num_joints();
  for (const Dof::Drive& drive : skeleton.dofs[skeleton.root().rotation[0]].joints)
    if (drive.weight != 0.0) joint = std::min(joint, drive.joint);  // parents come first
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  for (; joint >= 0; joint = skeleton.joints[joint].parent) offset += skeleton.joints[joint].offset;
  return {offset.x(), offset.y(), offset.z()};
}

PoseDofs::PoseDofs(const Skeleton& skeleton, const std::vector<std::string>& patterns, const std::vector<double>& given)
    : root_(skeleton.root()), given_(doubles(given)) {
  if (static_cast<int>(given.size()) != skeleton.num_dofs())
    fail<UsageError>("pose: {} values given for the {} DoFs of the skeleton", given.size(), skeleton.num_dofs());
  choose(skeleton, patterns);

  std::vector<int64_t> root_columns;
  std::vector<double> root_weights;
  for (int i = 0; i < 3; ++i) {
    root_columns.push_back(root_.translation[i]);
    root_weights.push_back(root_.translation_weight[i]);
  }
  for (int i = 0; i < 3; ++i) {
    root_columns.push_back(root_.rotation[i]);
    root_weights.push_back(root_.rotation_weight[i]);
  }
  root_columns_ = torch::tensor(root_columns, torch::kInt64);
  root_weight_ = doubles(root_weights);
  const std::array<double, 3> pivot = root_pivot(skeleton);
  pivot_ = doubles({pivot[0], pivot[1], pivot[2]});
  check_pivot(skeleton, root_, {pivot[0], pivot[1], pivot[2]});
}

void PoseDofs::choose(const Skeleton& skeleton, const std::vector<std::string>& patterns) {
  std::vector<bool> chosen(skeleton.dofs.size(), patterns.empty() || patterns.front().rfind('!', 0) == 0);
  for (const std::string& pattern : patterns) {
    const bool takes_out = pattern.rfind('!', 0) == 0;
    const std::vector<int> found = find_dofs(skeleton, pattern.substr(takes_out ? 1 : 0));
    for (const int dof : found) chosen[dof] = !takes_out;
    if (found.empty())
      fail<UsageError>("pose: no DoF of the skeleton is called '{}' (`*` stands for any characters)", pattern);
  }
  for (int dof : root_.translation) chosen[dof] = false;
  for (int dof : root_.rotation) chosen[dof] = false;

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<int64_t> columns;
  std::vector<double> scale, lower, upper, middle;
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    const Dof& dof = skeleton.dofs[d];
    const double unit = dof_reach(skeleton, dof);
    if (!chosen[d] || unit == 0.0) continue;
    names_.push_back(dof.name);
    columns.push_back(d);
    scale.push_back(unit);
    lower.push_back(dof.limits ? unit * (*dof.limits)[0] : -kInfinity);
    upper.push_back(dof.limits ? unit * (*dof.limits)[1] : kInfinity);
    middle.push_back(dof.limits ? 0.5 * (lower.back() + upper.back()) : unit * given_[d].item<double>());
  }
  if (columns.empty()) fail<UsageError>("pose: none of the named DoFs moves a joint other than the root");
  columns_ = torch::tensor(columns, torch::kInt64);
  scale_ = doubles(scale);
  lower_ = doubles(lower);
  upper_ = doubles(upper);
  middle_ = doubles(middle);
}

Tensor PoseDofs::assemble(const Tensor& theta, const Tensor& root_values) const {
  return per_sample(given_, theta)
      .index_copy(1, index_like(columns_, theta), theta / constant_like(scale_, theta))
      .index_copy(1, index_like(root_columns_, theta), root_values / constant_like(root_weight_, theta));
}

Tensor PoseDofs::dofs(const Tensor& theta, const Tensor& rotation, const Tensor& position) const {
  check_shape("pose", "theta", theta, {-1, size()}, "[B,P]");
  check_shape("pose", "rotation", rotation, {theta.size(0), 3, 3}, "[B,3,3]");
  check_shape("pose", "position", position, {theta.size(0), 3}, "[B,3]");
  return assemble(theta,
                  torch::cat({position - constant_like(pivot_, theta), rotation_to_angles(rotation, root_.axes)}, -1));
}

Tensor PoseDofs::root_relative(const Tensor& theta) const {
  check_shape("pose", "theta", theta, {-1, size()}, "[B,P]");
  const Tensor still = torch::cat({-pivot_, torch::zeros({3}, torch::kFloat64)});
  return assemble(theta, per_sample(still, theta));
}

Tensor PoseDofs::theta(const Tensor& dofs) const {
  check_shape("pose", "dofs", dofs, {-1, num_dofs()}, "[B,D]");
  return dofs.index_select(1, index_like(columns_, dofs)) * constant_like(scale_, dofs);
}

Tensor PoseDofs::rotation(const Tensor& dofs) const {
  check_shape("pose", "dofs", dofs, {-1, num_dofs()}, "[B,D]");
  const Tensor angles = dofs.index_select(1, index_like(root_columns_.narrow(0, 3, 3), dofs)) *
                        constant_like(root_weight_.narrow(0, 3, 3), dofs);
  return angles_to_rotation(angles, root_.axes);
}

Tensor PoseDofs::position(const Tensor& dofs) const {
  check_shape("pose", "dofs", dofs, {-1, num_dofs()}, "[B,D]");
  return dofs.index_select(1, index_like(root_columns_.narrow(0, 0, 3), dofs)) *
             constant_like(root_weight_.narrow(0, 0, 3), dofs) +
         constant_like(pivot_, dofs);
}

}  // namespace doppel
