#include "doppel/losses/limits.h"

#include <algorithm>

#include "doppel/core/tensor/checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

torch::Tensor limits_loss(const torch::Tensor& theta, const torch::Tensor& lower, const torch::Tensor& upper) {
  check_shape("limits_loss", "theta", theta, {-1, -1}, "[B,P]");
  check_shape("limits_loss", "lower", lower, {theta.size(1)}, "[P]");
  check_shape("limits_loss", "upper", upper, {theta.size(1)}, "[P]");
  const torch::Tensor excess =
      (theta - constant_like(upper, theta)).clamp_min(0) + (constant_like(lower, theta) - theta).clamp_min(0);
  return excess.square().sum() / std::max<int64_t>(theta.size(0), 1);
}

}  // namespace doppel
