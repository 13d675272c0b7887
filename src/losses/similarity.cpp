#include "doppel/losses/similarity.h"

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr std::int64_t kWindow = 11;
constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

/// The weights of a window along one axis, [11].
Tensor window_weights(const Tensor& like) {
  const Tensor x = torch::arange(kWindow, like.options()) - (kWindow - 1) / 2;
  const Tensor w = (x.square() * (-0.5 / (kSigma * kSigma))).exp();
  return w / w.sum();
}

/// Means over the windows. @param planes [P,1,H,W]
Tensor local_mean(const Tensor& planes, const Tensor& weights) {
  return torch::conv2d(torch::conv2d(planes, weights.view({1, 1, 1, -1})), weights.view({1, 1, -1, 1}));
}

}  // namespace

Tensor similarity_loss(const Tensor& a_in, const Tensor& b_in) {
  check_shape("similarity_loss", "a", a_in, {-1, -1, -1, -1, 3}, "[B,C,H,W,3]");
  check_shape("similarity_loss", "b", b_in, a_in.sizes(), "[B,C,H,W,3]");
  if (a_in.size(2) < kWindow || a_in.size(3) < kWindow)
    fail<UsageError>("similarity_loss: images of {} x {} pixels; each side must have at least {}", a_in.size(3),
                     a_in.size(2), kWindow);
  const auto planes = [](const Tensor& image) {
    return image.permute({0, 1, 4, 2, 3}).reshape({-1, 1, image.size(2), image.size(3)});
  };
  const Tensor a = planes(a_in), b = planes(b_in), weights = window_weights(a);
  const auto means = local_mean(torch::cat({a, b, a * a, b * b, a * b}), weights).chunk(5);
  const Tensor variance_a = means[2] - means[0] * means[0], variance_b = means[3] - means[1] * means[1],
               covariance = means[4] - means[0] * means[1];
  const Tensor similarity = (2 * means[0] * means[1] + kC1) * (2 * covariance + kC2) /
                            ((means[0] * means[0] + means[1] * means[1] + kC1) * (variance_a + variance_b + kC2));
  return 1 - similarity.mean();
}

}  // namespace doppel
