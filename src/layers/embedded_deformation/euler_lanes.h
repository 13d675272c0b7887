#pragma once

/// For kernel files only: rotation matrices of Euler angles and their derivative, L items at once.

#include "doppel/layers/lanes.h"

namespace doppel::kernels::DOPPEL_ISA {

/// Rz(A_3) Ry(A_2) Rx(A_1), row-major, from angles [3,L]; and the x and y of the (horizontal) axis about which a change
/// of A_2 rotates the result. A change of A_1 rotates it about its own column 0, a change of A_3 about z.
template <int L>
inline void euler_rotation(const float* angles, Vector<L>* R, Vector<L>* axis_y) {
  Vector<L> sx, cx, sy, cy, sz, cz;
  sine_cosine<L>(load<L>(angles), &sx, &cx);
  sine_cosine<L>(load<L>(angles + L), &sy, &cy);
  sine_cosine<L>(load<L>(angles + 2 * L), &sz, &cz);
  R[0] = cz * cy;
  R[1] = cz * sy * sx - sz * cx;
  R[2] = cz * sy * cx + sz * sx;
  R[3] = sz * cy;
  R[4] = sz * sy * sx + cz * cx;
  R[5] = sz * sy * cx - cz * sx;
  R[6] = -sy;
  R[7] = cy * sx;
  R[8] = cy * cx;
  axis_y[0] = -sz;
  axis_y[1] = cz;
}

/// Gradient [3,L] to the angles from the gradient G to the rotation. The derivative of R for a rotation about an axis a
/// is [a]x R, and <G, [a]x R> = a . torque with torque = sum over columns of R_k x G_k.
template <int L>
inline void euler_adjoint(const float* angles, const Vector<L>* G, float* grad_angles) {
  Vector<L> R[9], axis_y[2], torque[3];
  euler_rotation<L>(angles, R, axis_y);
  for (int r = 0; r < 3; ++r) {
    const int i = 3 * ((r + 1) % 3), j = 3 * ((r + 2) % 3);
    torque[r] = R[i] * G[j] - R[j] * G[i] + R[i + 1] * G[j + 1] - R[j + 1] * G[i + 1] + R[i + 2] * G[j + 2] -
                R[j + 2] * G[i + 2];
  }
  store<L>(grad_angles, R[0] * torque[0] + R[3] * torque[1] + R[6] * torque[2]);
  store<L>(grad_angles + L, axis_y[0] * torque[0] + axis_y[1] * torque[1]);
  store<L>(grad_angles + 2 * L, torque[2]);
}

}  // namespace doppel::kernels::DOPPEL_ISA
