#include "doppel/nets/motion_window.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/pose_dofs.h"
#include "doppel/layers/rotation_math.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kUp = 1;  // y

Tensor column(const Tensor& dofs, int dof, double weight) { return dofs.select(-1, dof) * weight; }

}  // namespace

Tensor wrap_angle(const Tensor& angle) {
  // ceil, not floor or round: -pi is mapped to +pi.
  return angle - at::ceil((angle - M_PI) / (2.0 * M_PI)) * (2.0 * M_PI);
}

Tensor last_rows(const Tensor& dof_window, int past_frames) {
  if (dof_window.dim() != 3 || dof_window.size(1) < past_frames + 1)
    fail<UsageError>("a motion window of at least {} frames is needed, found {}", past_frames + 1,
                     dof_window.dim() == 3 ? dof_window.size(1) : 0);
  return dof_window.narrow(1, dof_window.size(1) - past_frames - 1, past_frames + 1).contiguous();
}

MotionWindow::MotionWindow(const Skeleton& skeleton)
    : root_(skeleton.root()), offset_(root_pivot(skeleton)), num_dofs_(skeleton.num_dofs()) {}

Tensor MotionWindow::heading(const Tensor& dofs) const {
  check_shape("motion window", "dofs", dofs, {-1, num_dofs_}, "[B,D]");
  if (heading_is_outermost()) return wrap_angle(column(dofs, root_.rotation[0], root_.rotation_weight[0]));
  Tensor rotation;
  for (int i = 0; i < 3; ++i) {
    const Tensor next = axis_rotation(column(dofs, root_.rotation[i], root_.rotation_weight[i]), root_.axes[i]);
    rotation = i == 0 ? next : at::matmul(rotation, next);
  }
  return at::atan2(rotation.select(-2, 0).select(-1, 2), rotation.select(-2, 2).select(-1, 2));
}

Tensor MotionWindow::translation(const Tensor& dofs) const {
  std::vector<Tensor> axes;
  for (int axis = 0; axis < 3; ++axis)
    axes.push_back(column(dofs, root_.translation[axis], root_.translation_weight[axis]));
  return at::stack(axes, -1);
}

Tensor MotionWindow::normaliser(const Tensor& dofs) const {
  const Tensor turn = axis_rotation(-heading(dofs), kUp);
  const Tensor offset = torch::tensor({offset_[0], offset_[1], offset_[2]}, dofs.options());
  const Tensor pivot = translation(dofs) + offset;
  const Tensor moved = offset - at::matmul(turn, pivot.unsqueeze(-1)).squeeze(-1);
  return at::cat({turn, moved.unsqueeze(-1)}, -1);
}

Tensor MotionWindow::translation_normaliser(const Tensor& dofs) const {
  check_shape("motion window", "dofs", dofs, {-1, num_dofs_}, "[B,D]");
  const Tensor moved = -translation(dofs).unsqueeze(-1);
  const Tensor identity = torch::eye(3, dofs.options()) + torch::zeros_like(moved);  // for any batch size in a trace
  return at::cat({identity, moved}, -1);
}

Tensor MotionWindow::remove_translation(const Tensor& window) const {
  check_shape("motion window", "window", window, {-1, -1, num_dofs_}, "[B,F+1,D]");
  const Tensor last = window.select(1, window.size(1) - 1);
  std::vector<Tensor> columns = window.unbind(-1);
  for (int axis = 0; axis < 3; ++axis) {
    const int dof = root_.translation[axis];
    columns[dof] = columns[dof] - last.select(-1, dof).unsqueeze(-1);
  }
  return at::stack(columns, -1);
}

Tensor MotionWindow::normalise_dofs(const Tensor& window) const {
  check_shape("motion window", "window", window, {-1, -1, num_dofs_}, "[B,F+1,D]");
  if (!heading_is_outermost())
    fail(
        "the heading cannot be removed from the DoFs of this skeleton: its outermost root rotation is about {}, not y; "
        "normalise the transforms instead (MotionWindow::normaliser)",
        "xyz"[root_.axes[0]]);
  const Tensor last = window.select(1, window.size(1) - 1);
  const Tensor turn = axis_rotation(-heading(last), kUp).unsqueeze(1);
  const Tensor relative = translation(window) - translation(last).unsqueeze(1);
  const Tensor moved = at::matmul(turn, relative.unsqueeze(-1)).squeeze(-1);
  const Tensor turned =
      wrap_angle(column(window, root_.rotation[0], root_.rotation_weight[0]) - heading(last).unsqueeze(1));

  std::vector<Tensor> columns = window.unbind(-1);
  for (int axis = 0; axis < 3; ++axis)
    columns[root_.translation[axis]] = moved.select(-1, axis) / root_.translation_weight[axis];
  columns[root_.rotation[0]] = turned / root_.rotation_weight[0];
  return at::stack(columns, -1);
}

}  // namespace doppel
