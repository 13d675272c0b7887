#include "doppel/layers/rotation_math.h"

#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

Tensor axis_rotation(const Tensor& angle, int axis) {
  const Tensor c = angle.cos(), s = angle.sin(), zero = at::zeros_like(angle), one = at::ones_like(angle);
  std::vector<Tensor> entries;
  switch (axis) {
    case 0:
      entries = {one, zero, zero, zero, c, -s, zero, s, c};
      break;
    case 1:
      entries = {c, zero, s, zero, one, zero, -s, zero, c};
      break;
    default:
      entries = {c, -s, zero, s, c, zero, zero, zero, one};
  }
  std::vector<Tensor> rows;
  for (int row = 0; row < 3; ++row)
    rows.push_back(at::stack({entries[3 * row], entries[3 * row + 1], entries[3 * row + 2]}, -1));
  return at::stack(rows, -2);
}

Tensor angles_to_rotation(const Tensor& angles, const std::array<int, 3>& axes) {
  Tensor rotation = axis_rotation(angles.select(-1, 0), axes[0]);
  for (int i : {1, 2}) rotation = at::matmul(rotation, axis_rotation(angles.select(-1, i), axes[i]));
  return rotation;
}

Tensor rotation_to_angles(const Tensor& rotation, const std::array<int, 3>& axes) {
  if (!rotation.defined() || !rotation.is_floating_point() || rotation.dim() < 2 || rotation.size(-1) != 3 ||
      rotation.size(-2) != 3)
    fail<UsageError>("rotation_to_angles: rotation must be a floating-point tensor [...,3,3], found {}",
                     describe(rotation));
  const auto [i, j, k] = axes;
  // +1 if the axes are a cyclic permutation of x y z, otherwise -1.
  const double sign = (j - i + 3) % 3 == 1 ? 1.0 : -1.0;
  const auto m = [&](int row, int column) { return rotation.select(-2, row).select(-1, column); };
  constexpr double kPole = 1e-6;
  const Tensor squared = m(k, k) * m(k, k) + m(j, k) * m(j, k);
  const Tensor singular = squared < kPole * kPole;
  // Chosen before atan2, whose derivative at (0,0) is not finite. The clamp avoids the same problem for the root.
  const auto choose = [&](const Tensor& at_pole, const Tensor& elsewhere) {
    return torch::where(singular, at_pole, elsewhere);
  };
  const Tensor inner = torch::atan2(choose(sign * m(j, i), -sign * m(i, j)), choose(m(j, j), m(i, i)));
  const Tensor middle = torch::atan2(sign * m(i, k), squared.clamp_min(kPole * kPole).sqrt());
  const Tensor outer =
      torch::atan2(choose(torch::zeros_like(squared), -sign * m(j, k)), choose(torch::ones_like(squared), m(k, k)));
  return torch::stack({outer, middle, inner}, -1);
}

}  // namespace doppel
