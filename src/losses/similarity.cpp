#include "doppel/losses/similarity.h"

#include <ATen/Parallel.h>
#include <torch/autograd.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/losses/similarity_kernel.h"

namespace doppel {
namespace {

using kernels::kSsimStrip;
using kernels::kSsimWindow;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

constexpr double kSigma = 1.5, kC1 = kernels::kSsimC1, kC2 = kernels::kSsimC2;

void check_images(const Tensor& a, const Tensor& b) {
  check_tensor("similarity_loss", "a", a, {torch::kFloat32, torch::kFloat64}, {-1, -1, -1, -1, 3}, "[B,C,H,W,3]");
  check_shape("similarity_loss", "b", b, a.sizes(), "[B,C,H,W,3]");
  check_same_kind("similarity_loss", "b", b, a);
  if (a.size(2) < kSsimWindow || a.size(3) < kSsimWindow)
    fail<UsageError>("similarity_loss: images of {} x {} pixels; each side must have at least {}", a.size(3), a.size(2),
                     kSsimWindow);
}

/// The weights of a window along one axis.
std::vector<double> window_weights() {
  std::vector<double> w;
  double sum = 0.0;
  constexpr int kMiddle = kSsimWindow / 2;
  for (int i = 0; i < kSsimWindow; ++i) {
    const double x = (i - kMiddle) / kSigma;
    w.push_back(std::exp(-0.5 * x * x));
    sum += w.back();
  }
  for (double& weight : w) weight /= sum;
  return w;
}

// --- kernel ----------------------------------------------------------------------------------------------------------

/// The pixels where one of two images [H,W,3] is not black.
struct Box {
  std::int64_t x0, x1, y0, y1;  ///< x1, y1 excluded
};
Box lit_box(const float* a, const float* b, std::int64_t height, std::int64_t width) {
  Box box{width, 0, height, 0};
  for (std::int64_t y = 0; y < height; ++y) {
    const float *row_a = a + 3 * width * y, *row_b = b + 3 * width * y;
    const auto lit = [&](std::int64_t x) {
      for (std::int64_t i = 3 * x; i < 3 * x + 3; ++i) {
        if (row_a[i] != 0.0f || row_b[i] != 0.0f) return true;
      }
      return false;
    };
    std::int64_t first = 0, last = width;
    while (first < width && !lit(first)) ++first;
    if (first == width) continue;
    while (!lit(last - 1)) --last;
    box = {std::min(box.x0, first), std::max(box.x1, last), std::min(box.y0, y), y + 1};
  }
  return box;
}

std::int64_t scratch_floats(std::int64_t columns) {
  const std::int64_t n = 3 * columns, pixels = n + 3 * (kSsimWindow - 1);
  return kernels::kSsimMoments * (kernels::kSsimRows + kSsimStrip) * n + 3 * pixels;
}

/// The mean of 1 - similarity of an image. @param gradient that of the sum of similarities to `a` is added; null: none
double image_loss(const float* a, const float* b, std::int64_t height, std::int64_t width, float* gradient) {
  const Box lit = lit_box(a, b, height, width);
  const std::int64_t reach = kSsimWindow - 1, columns = width - reach, rows = height - reach;
  const double windows = static_cast<double>(3 * columns * rows);
  const std::int64_t x0 = std::max<std::int64_t>(lit.x0 - reach, 0), x1 = std::min(lit.x1, columns);
  const std::int64_t y0 = std::max<std::int64_t>(lit.y0 - reach, 0), y1 = std::min(lit.y1, rows);
  if (lit.x1 <= lit.x0 || x1 <= x0 || y1 <= y0) return 0.0;
  const std::vector<double> precise = window_weights();
  const std::vector<float> weights(precise.begin(), precise.end());
  std::vector<float> scratch(as_size(scratch_floats(x1 - x0)));
  double lost = 0.0;
  for (std::int64_t y = y0; y < y1; y += kSsimStrip) {
    const std::int64_t end = std::min<std::int64_t>(y + kSsimStrip, y1);
    lost += static_cast<double>(3 * (end - y) * (x1 - x0)) -
            kernels::similarity_strip({a, b, width, x0, x1, y, end, weights.data(), gradient, scratch.data()});
  }
  return lost / windows;
}

class Similarity : public torch::autograd::Function<Similarity> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& a_in, const Tensor& b_in, bool wants_gradient) {
    const Tensor a = a_in.contiguous(), b = b_in.contiguous();
    const std::int64_t images = a.size(0) * a.size(1), height = a.size(2), width = a.size(3);
    const std::int64_t floats = 3 * height * width;
    const Tensor gradient = wants_gradient ? torch::zeros_like(a) : Tensor();
    std::vector<double> losses(as_size(images));
    at::parallel_for(0, images, 1, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t i = begin; i < end; ++i)
        losses[i] = image_loss(a.data_ptr<float>() + floats * i, b.data_ptr<float>() + floats * i, height, width,
                               wants_gradient ? gradient.data_ptr<float>() + floats * i : nullptr);
    });
    double sum = 0.0;
    for (const double loss : losses) sum += loss;
    if (wants_gradient) {
      const auto windows = static_cast<double>(3 * images * (height - kSsimWindow + 1) * (width - kSsimWindow + 1));
      context->save_for_backward({gradient.mul_(-1.0 / windows)});
    }
    return torch::tensor(sum / static_cast<double>(std::max<std::int64_t>(images, 1)), a.options());
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    variable_list out = once_differentiable({context->get_saved_variables()[0] * upstream[0]}, "similarity_loss");
    return {out[0], Tensor(), Tensor()};
  }
};

/// Means over the windows. @param planes [P,1,H,W]
Tensor local_mean(const Tensor& planes, const Tensor& weights) {
  return torch::conv2d(torch::conv2d(planes, weights.view({1, 1, 1, -1})), weights.view({1, 1, -1, 1}));
}

}  // namespace

Tensor similarity_loss_reference(const Tensor& a_in, const Tensor& b_in) {
  check_images(a_in, b_in);
  const auto planes = [](const Tensor& image) {
    return image.permute({0, 1, 4, 2, 3}).reshape({-1, 1, image.size(2), image.size(3)});
  };
  const Tensor a = planes(a_in), b = planes(b_in), weights = torch::tensor(window_weights(), a.options());
  const auto means = local_mean(torch::cat({a, b, a * a, b * b, a * b}), weights).chunk(5);
  const Tensor variance_a = means[2] - means[0] * means[0], variance_b = means[3] - means[1] * means[1],
               covariance = means[4] - means[0] * means[1];
  const Tensor similarity = (2 * means[0] * means[1] + kC1) * (2 * covariance + kC2) /
                            ((means[0] * means[0] + means[1] * means[1] + kC1) * (variance_a + variance_b + kC2));
  return 1 - similarity.mean();
}

Tensor similarity_loss(const Tensor& a, const Tensor& b) {
  check_images(a, b);
  if (a.scalar_type() != torch::kFloat32) return similarity_loss_reference(a, b.detach());
  return Similarity::apply(a, b.detach(), torch::GradMode::is_enabled() && a.requires_grad());
}

}  // namespace doppel
