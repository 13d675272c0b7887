#include "doppel/losses/laplacian_kernel.h"

#include "doppel/layers/lanes.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

/// n_i x_i - sum over neighbours of x_j, for rows of four floats.
inline Quad laplacian_of(const LaplacianParams& p, const float* rows, int64_t i) {
  const Quad own = load<4>(rows + 4 * i);
  Quad sum{};
  for (int32_t e = p.offsets[i]; e < p.offsets[i + 1]; ++e) {
    sum += own - load<4>(rows + 4 * static_cast<int64_t>(p.neighbours[e]));
  }
  return sum;
}

}  // namespace

void laplacian_item(LaplacianParams& p) {
  for (int64_t i = 0; i < p.num_vertices; ++i) {
    const float *a = p.refined + 3 * i, *b = p.coarse + 3 * i;
    store<4>(p.displacement + 4 * i, Quad{a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0f});
  }
  double sum = 0.0;
  for (int64_t i = 0; i < p.num_vertices; ++i) {
    const Quad r = laplacian_of(p, p.displacement, i);
    const Quad weighted = r * p.weight[i], square = r * weighted;
    store<4>(p.laplacian + 4 * i, weighted);
    sum += static_cast<double>(square[0] + square[1] + square[2]);
  }
  p.sum = sum;
  if (p.gradient == nullptr) return;
  // The operator is symmetric: its adjoint is itself.
  for (int64_t i = 0; i < p.num_vertices; ++i) {
    const Quad g = 2.0f * p.scale * laplacian_of(p, p.laplacian, i);
    for (int c = 0; c < 3; ++c) p.gradient[3 * i + c] = g[c];
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
