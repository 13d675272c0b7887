#include "doppel/layers/kinematics/kinematics_kernel.h"

#include <cmath>

namespace doppel::kernels::DOPPEL_ISA {
namespace {

// Transforms are 12 doubles, rows of [R|t].

/// c = a * b.
void compose(const double* a, const double* b, double* c) {
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 4; ++k) {
      c[4 * r + k] =
          a[4 * r] * b[k] + a[4 * r + 1] * b[4 + k] + a[4 * r + 2] * b[8 + k] + (k == 3 ? a[4 * r + 3] : 0.0);
    }
  }
}

/// Adjoint of c = a * b with respect to a: grad_a += grad_c b^T, with b as a 4x4 matrix.
void add_left_adjoint(const double* grad_c, const double* b, double* grad_a) {
  for (int r = 0; r < 3; ++r) {
    const double* g = grad_c + 4 * r;
    for (int k = 0; k < 3; ++k) {
      grad_a[4 * r + k] += g[0] * b[4 * k] + g[1] * b[4 * k + 1] + g[2] * b[4 * k + 2] + g[3] * b[4 * k + 3];
    }
    grad_a[4 * r + 3] += g[3];
  }
}

double joint_value(const KinematicsParams& p, int64_t j, const float* dofs) {
  double q = 0.0;
  for (int32_t e = p.drive_offsets[j]; e < p.drive_offsets[j + 1]; ++e) q += p.drive_weight[e] * dofs[p.drive_dof[e]];
  return q;
}

/// Parent-from-joint transform: Trans(offset) * Rot(axis, q) or Trans(offset + axis q).
void local_transform(const KinematicsParams& p, int64_t j, double q, double* local) {
  const double* offset = p.geometry + 6 * j;
  const double* axis = offset + 3;
  const bool slides = p.prismatic[j] != 0;
  const double s = slides ? 0.0 : std::sin(q), v = slides ? 0.0 : 1.0 - std::cos(q);
  const double x = axis[0], y = axis[1], z = axis[2];
  // I + s K + v K^2 with K = [axis]x, for any length of the axis, as in the reference.
  const double rotation[9] = {1.0 - v * (y * y + z * z), -s * z + v * x * y,        s * y + v * x * z,
                              s * z + v * x * y,         1.0 - v * (x * x + z * z), -s * x + v * y * z,
                              -s * y + v * x * z,        s * x + v * y * z,         1.0 - v * (x * x + y * y)};
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 3; ++k) local[4 * r + k] = rotation[3 * r + k];
    local[4 * r + 3] = offset[r] + (slides ? axis[r] * q : 0.0);
  }
}

/// World transforms of all joints for one pose.
void pose_joints(const KinematicsParams& p, const float* dofs, double* world) {
  for (int64_t j = 0; j < p.num_joints; ++j) {
    double local[12];
    local_transform(p, j, joint_value(p, j, dofs), local);
    if (p.parent[j] < 0) {
      for (int i = 0; i < 12; ++i) world[12 * j + i] = local[i];
    } else {
      compose(world + 12 * p.parent[j], local, world + 12 * j);
    }
  }
}

/// dL/dq of one joint, given its world transform, its parent's, and the adjoint of its world transform.
double joint_gradient(const KinematicsParams& p, int64_t j, const double* world, const double* grad) {
  const double* axis = p.geometry + 6 * j + 3;
  double sum = 0.0;
  if (p.prismatic[j] != 0) {
    // A = A_parent Trans(offset + axis q): dt/dq = R_parent axis, and R_parent = R.
    for (int r = 0; r < 3; ++r) {
      sum += grad[4 * r + 3] * (world[4 * r] * axis[0] + world[4 * r + 1] * axis[1] + world[4 * r + 2] * axis[2]);
    }
    return sum;
  }
  // R = R_parent exp(q [axis]x): dR/dq = R [axis]x; the translation does not depend on q. A row r of R gives the row
  // r x axis of R [axis]x.
  for (int r = 0; r < 3; ++r) {
    const double* w = world + 4 * r;
    const double* g = grad + 4 * r;
    sum += g[0] * (w[1] * axis[2] - w[2] * axis[1]) + g[1] * (w[2] * axis[0] - w[0] * axis[2]) +
           g[2] * (w[0] * axis[1] - w[1] * axis[0]);
  }
  return sum;
}

void backward_item(const KinematicsParams& p, const float* dofs, const float* grad_frames, float* grad_dofs,
                   double* scratch) {
  double* world = scratch;
  double* grad = scratch + 12 * p.num_joints;
  double* grad_dof = grad + 12 * p.num_joints;
  pose_joints(p, dofs, world);
  for (int64_t i = 0; i < 12 * p.num_joints; ++i) grad[i] = 0.0;
  for (int64_t d = 0; d < p.num_dofs; ++d) grad_dof[d] = 0.0;
  for (int64_t m = 0; m < p.num_frames; ++m) {
    double grad_frame[12];
    for (int i = 0; i < 12; ++i) grad_frame[i] = grad_frames[12 * m + i];
    add_left_adjoint(grad_frame, p.frame_local + 12 * m, grad + 12 * p.frame_joint[m]);
  }
  // Children come after their parents, so in reverse order the adjoint of a joint is complete when it is read.
  for (int64_t j = p.num_joints - 1; j >= 0; --j) {
    const double gradient = joint_gradient(p, j, world + 12 * j, grad + 12 * j);
    for (int32_t e = p.drive_offsets[j]; e < p.drive_offsets[j + 1]; ++e) {
      grad_dof[p.drive_dof[e]] += p.drive_weight[e] * gradient;
    }
    if (p.parent[j] < 0) continue;
    double local[12];
    local_transform(p, j, joint_value(p, j, dofs), local);
    add_left_adjoint(grad + 12 * j, local, grad + 12 * p.parent[j]);
  }
  for (int64_t d = 0; d < p.num_dofs; ++d) grad_dofs[d] = static_cast<float>(grad_dof[d]);
}

}  // namespace

void kinematics_forward(const KinematicsParams& p, int64_t begin, int64_t end, double* scratch) {
  for (int64_t b = begin; b < end; ++b) {
    pose_joints(p, p.dofs + b * p.num_dofs, scratch);
    float* out = p.frames + b * p.num_frames * 12;
    for (int64_t m = 0; m < p.num_frames; ++m) {
      double frame[12];
      compose(scratch + 12 * p.frame_joint[m], p.frame_local + 12 * m, frame);
      for (int i = 0; i < 12; ++i) out[12 * m + i] = static_cast<float>(frame[i]);
    }
  }
}

void kinematics_backward(const KinematicsParams& p, int64_t begin, int64_t end, double* scratch) {
  for (int64_t b = begin; b < end; ++b) {
    backward_item(p, p.dofs + b * p.num_dofs, p.grad_frames + b * p.num_frames * 12, p.grad_dofs + b * p.num_dofs,
                  scratch);
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
