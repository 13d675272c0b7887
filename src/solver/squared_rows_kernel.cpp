// Normal equations of dense rows: sums of outer products, computed one register tile of the sum at a time.

#include "doppel/solver/squared_rows_kernel.h"

#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int64_t kWidth = kVectorBytes / sizeof(double);
// A tile of the sum: eight registers.
constexpr int64_t kAcross = kPanelStep / kWidth < 2 ? 1 : 2, kWide = kAcross * kWidth, kTall = 8 / kAcross;
static_assert(kPanelStep % kWide == 0 && kPanelStep % kTall == 0);

typedef double Vec __attribute__((vector_size(kWidth * sizeof(double))));
typedef double LooseVec __attribute__((vector_size(kWidth * sizeof(double)), aligned(8), may_alias));

inline Vec load(const double* p) { return *reinterpret_cast<const LooseVec*>(p); }
inline void add(double* p, Vec v) { *reinterpret_cast<LooseVec*>(p) = load(p) + v; }

/// Rows i.. and columns j.. of the sum.
inline void add_tile(const double* rows, int64_t num_rows, int64_t columns, int64_t i, int64_t j, double* sum) {
  Vec tile[kTall][kAcross] = {};
  for (int64_t r = 0; r < num_rows; ++r) {
    const double* row = rows + r * columns;
    Vec right[kAcross];
    for (int64_t w = 0; w < kAcross; ++w) right[w] = load(row + j + w * kWidth);
    for (int64_t k = 0; k < kTall; ++k)
      for (int64_t w = 0; w < kAcross; ++w) tile[k][w] += row[i + k] * right[w];
  }
  for (int64_t k = 0; k < kTall; ++k)
    for (int64_t w = 0; w < kAcross; ++w) add(sum + (i + k) * columns + j + w * kWidth, tile[k][w]);
}

}  // namespace

void add_squared_rows(const double* rows, int64_t num_rows, int64_t columns, double* sum) {
  for (int64_t i = 0; i < columns; i += kTall)
    for (int64_t j = i / kWide * kWide; j < columns; j += kWide) add_tile(rows, num_rows, columns, i, j, sum);
}

}  // namespace doppel::kernels::DOPPEL_ISA
