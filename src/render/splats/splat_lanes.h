#pragma once

/// For kernel files only (see cpu_dispatch.h): eight lanes on every instruction set. A row of a Gaussian is seldom wider
/// than eight pixels, so wider vectors would stay empty.

#include <cstdint>
#include <cstring>

namespace doppel::kernels::DOPPEL_ISA {

constexpr int kEight = 8;
typedef float Float8 __attribute__((vector_size(32)));
typedef std::int32_t Int8 __attribute__((vector_size(32)));
typedef double Double8 __attribute__((vector_size(64)));

static inline Float8 eight(float x) { return x - Float8{}; }
static inline Float8 load8(const float* p) {
  Float8 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
static inline void store8(float* p, Float8 v) { std::memcpy(p, &v, sizeof v); }
// If a is NaN, these return b. Pass limits as b.
static inline Float8 min8(Float8 a, Float8 b) { return a < b ? a : b; }
static inline Float8 max8(Float8 a, Float8 b) { return a > b ? a : b; }
/// v where the mask is set, otherwise 0. Hides NaN.
static inline Float8 where8(Int8 mask, Float8 v) { return (Float8)(mask & (Int8)v); }
static inline Float8 sqrt8(Float8 v) {
  for (int i = 0; i < kEight; ++i) v[i] = __builtin_sqrtf(v[i]);
  return v;
}
static inline float sum8(Float8 v) {
  typedef float Float4 __attribute__((vector_size(16)));
  Float4 half = __builtin_shufflevector(v, v, 0, 1, 2, 3) + __builtin_shufflevector(v, v, 4, 5, 6, 7);
  half += __builtin_shufflevector(half, half, 2, 3, 0, 1);
  return half[0] + half[1];
}

/// 2^x to 2e-7 (relative) for -126 <= x <= 126; any value for other x. Rounding to the nearest integer, then a
/// polynomial of degree 5 through the Chebyshev nodes of [-1/2, 1/2].
static inline Float8 exp2_8(Float8 x) {
  const Float8 to_nearest = eight(12582912.0f);  // 1.5 * 2^23: the lowest bits of the sum are the integer
  const Float8 rounded = x + to_nearest;
  const Float8 f = x - (rounded - to_nearest), square = f * f;
  const Float8 low = 0.693147188f * f + 1.0f, middle = 0.0555035711f * f + 0.240221075f,
               high = 0.00133908634f * f + 0.00967603192f;
  const Float8 p = (high * square + middle) * square + low;
  return (Float8)((Int8)p + ((Int8)rounded << 23));
}

/// log2(x) to 2e-7 (absolute) for normal x > 0: exponent plus the series of atanh on [sqrt(1/2), sqrt(2)].
static inline Float8 log2_8(Float8 x) {
  const Int8 bits = (Int8)x, exponent = (bits - 0x3f3504f3) >> 23;
  const Float8 m = (Float8)(bits - (exponent << 23));
  const Float8 s = (m - 1.0f) / (m + 1.0f), square = s * s;
  Float8 series = square * 0.320598898f + 0.412198583f;
  series = series * square + 0.577078016f;
  series = series * square + 0.961796694f;
  series = series * square + 2.88539008f;
  return __builtin_convertvector(exponent, Float8) + s * series;
}

}  // namespace doppel::kernels::DOPPEL_ISA
