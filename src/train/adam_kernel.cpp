#include "doppel/train/adam_kernel.h"

#include <cmath>

namespace doppel::kernels::DOPPEL_ISA {

void adam_step(const AdamParams& p, std::int64_t begin, std::int64_t end) {
  float* __restrict parameter = p.parameter;
  const float* __restrict gradient = p.gradient;
  float* __restrict first = p.first_moment;
  float* __restrict second = p.second_moment;
  for (std::int64_t i = begin; i < end; ++i) {
    const float g = gradient[i] * p.gradient_scale;
    const float m = p.beta1 * first[i] + p.keep1 * g;
    const float v = p.beta2 * second[i] + p.keep2 * g * g;
    first[i] = m;
    second[i] = v;
    parameter[i] = parameter[i] * p.shrink - p.step_size * m / (std::sqrt(v) * p.inverse_root + p.epsilon);
  }
  if (p.mean == nullptr) return;
  float* __restrict mean = p.mean;
  for (std::int64_t i = begin; i < end; ++i) mean[i] += p.mean_rate * (parameter[i] - mean[i]);
}

double sum_of_squares(const float* values, std::int64_t begin, std::int64_t end) {
  constexpr int kLanes = 16;
  double lanes[kLanes] = {};
  std::int64_t i = begin;
  for (; i + kLanes <= end; i += kLanes)
    for (int k = 0; k < kLanes; ++k) lanes[k] += static_cast<double>(values[i + k]) * values[i + k];
  double sum = 0.0;
  for (; i < end; ++i) sum += static_cast<double>(values[i]) * values[i];
  for (double lane : lanes) sum += lane;
  return sum;
}

}  // namespace doppel::kernels::DOPPEL_ISA
