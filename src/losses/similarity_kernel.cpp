#include "doppel/losses/similarity_kernel.h"

#include <cstring>

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr float kC1 = static_cast<float>(kSsimC1), kC2 = static_cast<float>(kSsimC2);
constexpr int kRows = kSsimRows, kMoments = kSsimMoments;

/// out[i] = sum_t w[t] in[i + t * step]
inline void filter(const float* in, std::int64_t step, const float* w, std::int64_t count, float* out) {
  for (std::int64_t i = 0; i < count; ++i) out[i] = w[0] * in[i];
  for (int t = 1; t < kSsimWindow; ++t) {
    const float* from = in + t * step;
    for (std::int64_t i = 0; i < count; ++i) out[i] += w[t] * from[i];
  }
}

/// The adjoint: out[i + t * step] += w[t] in[i]
inline void spread(const float* in, std::int64_t step, const float* w, std::int64_t count, float* out) {
  for (int t = 0; t < kSsimWindow; ++t) {
    float* to = out + t * step;
    for (std::int64_t i = 0; i < count; ++i) to[i] += w[t] * in[i];
  }
}

/// The moments of the windows, filtered along rows, then along columns. @param along [5][kRows][n] @param moments
/// [5][kSsimStrip][n]
void find_moments(const SimilarityStrip& s, std::int64_t n, float* product, float* along, float* moments) {
  const std::int64_t pixels = n + 3 * (kSsimWindow - 1), rows = s.y1 - s.y0;
  for (std::int64_t row = 0; row < rows + kSsimWindow - 1; ++row) {
    const std::int64_t at = 3 * ((s.y0 + row) * s.width + s.x0);
    const float *a = s.a + at, *b = s.b + at;
    const auto filtered = [&](int k, const float* in) { filter(in, 3, s.weights, n, along + (k * kRows + row) * n); };
    filtered(0, a);
    filtered(1, b);
    for (std::int64_t i = 0; i < pixels; ++i) product[i] = a[i] * a[i];
    filtered(2, product);
    for (std::int64_t i = 0; i < pixels; ++i) product[i] = b[i] * b[i];
    filtered(3, product);
    for (std::int64_t i = 0; i < pixels; ++i) product[i] = a[i] * b[i];
    filtered(4, product);
  }
  for (int k = 0; k < kMoments; ++k) {
    for (std::int64_t row = 0; row < rows; ++row)
      filter(along + (k * kRows + row) * n, n, s.weights, n, moments + (k * kSsimStrip + row) * n);
  }
}

/// Sums the similarities of a row. Moments 0, 2 and 4 become the derivatives with respect to the means of a, aa and ab.
double compare_row(float* m0, float* m1, float* m2, float* m3, float* m4, std::int64_t n) {
  double sum = 0.0;
  for (std::int64_t i = 0; i < n; ++i) {
    const float mean_a = m0[i], mean_b = m1[i];
    const float a1 = 2.0f * mean_a * mean_b + kC1, a2 = 2.0f * (m4[i] - mean_a * mean_b) + kC2;
    const float b1 = mean_a * mean_a + mean_b * mean_b + kC1;
    const float b2 = (m2[i] - mean_a * mean_a) + (m3[i] - mean_b * mean_b) + kC2;
    const float scale = 1.0f / (b1 * b2), similarity = a1 * a2 * scale;
    const float to_aa = -similarity / b2, to_ab = 2.0f * a1 * scale;
    m0[i] = 2.0f * mean_b * a2 * scale - 2.0f * mean_a * similarity / b1 - 2.0f * mean_a * to_aa - mean_b * to_ab;
    m2[i] = to_aa;
    m4[i] = to_ab;
    sum += static_cast<double>(similarity);
  }
  return sum;
}

void add_gradient(const SimilarityStrip& s, std::int64_t n, const float* moments, float* along, float* wide) {
  const std::int64_t pixels = n + 3 * (kSsimWindow - 1), rows = s.y1 - s.y0;
  std::memset(along, 0, sizeof(float) * static_cast<std::size_t>(kMoments * kRows * n));
  for (int k = 0; k < kMoments; k += 2) {
    for (std::int64_t row = 0; row < rows; ++row)
      spread(moments + (k * kSsimStrip + row) * n, n, s.weights, n, along + (k * kRows + row) * n);
  }
  for (std::int64_t row = 0; row < rows + kSsimWindow - 1; ++row) {
    const std::int64_t at = 3 * ((s.y0 + row) * s.width + s.x0);
    std::memset(wide, 0, sizeof(float) * static_cast<std::size_t>(3 * pixels));
    for (int k = 0; k < 3; ++k) spread(along + (2 * k * kRows + row) * n, 3, s.weights, n, wide + k * pixels);
    const float *a = s.a + at, *b = s.b + at;
    float* out = s.gradient + at;
    for (std::int64_t i = 0; i < pixels; ++i)
      out[i] += wide[i] + 2.0f * a[i] * wide[pixels + i] + b[i] * wide[2 * pixels + i];
  }
}

}  // namespace

double similarity_strip(const SimilarityStrip& s) {
  const std::int64_t n = 3 * (s.x1 - s.x0);
  float *along = s.scratch, *moments = along + kMoments * kRows * n, *wide = moments + kMoments * kSsimStrip * n;
  find_moments(s, n, wide, along, moments);
  double sum = 0.0;
  for (std::int64_t row = 0; row < s.y1 - s.y0; ++row) {
    float* m = moments + row * n;
    const std::int64_t next = kSsimStrip * n;
    sum += compare_row(m, m + next, m + 2 * next, m + 3 * next, m + 4 * next, n);
  }
  if (s.gradient) add_gradient(s, n, moments, along, wide);
  return sum;
}

}  // namespace doppel::kernels::DOPPEL_ISA
