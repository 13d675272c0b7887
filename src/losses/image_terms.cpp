#include "doppel/losses/image_terms.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel::image_loss {

using torch::Tensor;

namespace {

void check_mask(const char* op, const char* argument, const Tensor& mask, const Tensor& rendered) {
  check_tensor(op, argument, mask, {torch::kBool, torch::kUInt8}, rendered.sizes().slice(0, 4), "[B,C,H,W]");
  if (mask.device() != rendered.device())
    fail<UsageError>("{}: {} is on {}, `rendered` on {}; move it with .to()", op, argument, mask.device().str(),
                     rendered.device().str());
}

}  // namespace

void check_images(const char* op, const Tensor& rendered, const Tensor& covered, const Tensor& target,
                  const Tensor& target_mask) {
  check_shape(op, "rendered", rendered, {-1, -1, -1, -1, 3}, "[B,C,H,W,3]");
  check_shape(op, "target", target, {rendered.size(0), rendered.size(1), rendered.size(2), rendered.size(3), 3},
              "[B,C,H,W,3]");
  check_same_kind(op, "target", target, rendered);
  check_mask(op, "covered", covered, rendered);
  check_mask(op, "target_mask", target_mask, rendered);
}

std::vector<double> gaussian_taps(double sigma, int half_size) {
  if (sigma == 0) return {1.0};
  std::vector<double> taps;
  double sum = 0.0;
  for (int i = 0; i <= half_size; ++i) {
    taps.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
    sum += (i == 0 ? 1.0 : 2.0) * taps.back();
  }
  for (double& tap : taps) tap /= sum;
  return taps;
}

Tensor binary(const Tensor& mask) { return mask.ne(0).to(torch::kUInt8); }

std::int64_t count_pixels(const Tensor& mask) { return mask.sum(torch::kInt64).item<std::int64_t>(); }

Tensor masked_reference(const Tensor& rendered, const Tensor& target, const PixelMask& mask, Measure measure) {
  const Tensor difference =
      torch::where(mask.weight.ne(0).unsqueeze(-1), 255.0 * (rendered - target), torch::zeros({}, rendered.options()));
  const Tensor sum = measure == Measure::squares ? 0.5 * difference.square().sum() : difference.abs().sum();
  return sum / (3.0 * static_cast<double>(std::max<std::int64_t>(mask.count, 1)));
}

}  // namespace doppel::image_loss
