#pragma once

/// For kernel files only (see cpu_dispatch.h): eight lanes on every instruction set. A row of a Gaussian is seldom
/// wider than eight pixels, so wider vectors would stay empty.

#include <cstdint>
#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace doppel::kernels::DOPPEL_ISA {

constexpr int kEight = 8;
typedef float Float8 __attribute__((vector_size(32)));
typedef std::int32_t Int8 __attribute__((vector_size(32)));
typedef std::uint32_t Unsigned8 __attribute__((vector_size(32)));
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
/// The bits of the lanes that a mask sets.
static inline unsigned bits8(Int8 mask) {
#if defined(__AVX2__)
  return static_cast<unsigned>(_mm256_movemask_ps((__m256)mask));
#else
  unsigned bits = 0;
  for (int i = 0; i < kEight; ++i) bits |= (mask[i] < 0 ? 1u : 0u) << i;
  return bits;
#endif
}
/// The lanes of v with the numbers `lanes`. V is a vector of eight 32-bit lanes.
template <typename V>
static inline V lanes8(V v, Int8 lanes) {
#if defined(__AVX2__)
  return (V)_mm256_permutevar8x32_ps((__m256)v, (__m256i)lanes);
#else
  V out{};
  for (int i = 0; i < kEight; ++i) out[i] = v[lanes[i]];
  return out;
#endif
}
static inline float sum8(Float8 v) {
  typedef float Float4 __attribute__((vector_size(16)));
  Float4 half = __builtin_shufflevector(v, v, 0, 1, 2, 3) + __builtin_shufflevector(v, v, 4, 5, 6, 7);
  half += __builtin_shufflevector(half, half, 2, 3, 0, 1);
  return half[0] + half[1];
}
/// Sums of neighbours of a, then of b, in each half: a0+a1 a2+a3 b0+b1 b2+b3, a4+a5 ...
static inline Float8 add_neighbours(Float8 a, Float8 b) {
  return __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14) +
         __builtin_shufflevector(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
}
/// The sums of the lanes of eight vectors.
static inline Float8 sums8(Float8 a, Float8 b, Float8 c, Float8 d, Float8 e, Float8 f, Float8 g, Float8 h) {
  const Float8 abcd = add_neighbours(add_neighbours(a, b), add_neighbours(c, d)),
               efgh = add_neighbours(add_neighbours(e, f), add_neighbours(g, h));
  return __builtin_shufflevector(abcd, efgh, 0, 1, 2, 3, 8, 9, 10, 11) +
         __builtin_shufflevector(abcd, efgh, 4, 5, 6, 7, 12, 13, 14, 15);
}

/// Columns of eight rows of three or four numbers, one after the other in memory.
static inline void load_rows3(const float* rows, Float8* out) {
  const Float8 a = load8(rows), b = load8(rows + 8), c = load8(rows + 16);
  out[0] =
      __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 3, 6, 9, 12, 15, 0, 0), c, 0, 1, 2, 3, 4, 5, 10, 13);
  out[1] =
      __builtin_shufflevector(__builtin_shufflevector(a, b, 1, 4, 7, 10, 13, 0, 0, 0), c, 0, 1, 2, 3, 4, 8, 11, 14);
  out[2] =
      __builtin_shufflevector(__builtin_shufflevector(a, b, 2, 5, 8, 11, 14, 0, 0, 0), c, 0, 1, 2, 3, 4, 9, 12, 15);
}
static inline void load_rows4(const float* rows, Float8* out) {
  const Float8 a = load8(rows), b = load8(rows + 8), c = load8(rows + 16), d = load8(rows + 24);
  const Float8 ab01 = __builtin_shufflevector(a, b, 0, 4, 8, 12, 1, 5, 9, 13),
               cd01 = __builtin_shufflevector(c, d, 0, 4, 8, 12, 1, 5, 9, 13),
               ab23 = __builtin_shufflevector(a, b, 2, 6, 10, 14, 3, 7, 11, 15),
               cd23 = __builtin_shufflevector(c, d, 2, 6, 10, 14, 3, 7, 11, 15);
  out[0] = __builtin_shufflevector(ab01, cd01, 0, 1, 2, 3, 8, 9, 10, 11);
  out[1] = __builtin_shufflevector(ab01, cd01, 4, 5, 6, 7, 12, 13, 14, 15);
  out[2] = __builtin_shufflevector(ab23, cd23, 0, 1, 2, 3, 8, 9, 10, 11);
  out[3] = __builtin_shufflevector(ab23, cd23, 4, 5, 6, 7, 12, 13, 14, 15);
}
/// The reverse: adds columns to rows of one, three or four numbers in memory.
template <int kColumns>
inline void add_to_rows(float* rows, const Float8* v);
template <>
inline void add_to_rows<1>(float* rows, const Float8* v) {
  store8(rows, load8(rows) + v[0]);
}
template <>
inline void add_to_rows<3>(float* rows, const Float8* v) {
  const Float8 a = __builtin_shufflevector(v[0], v[1], 0, 8, 0, 1, 9, 0, 2, 10),
               b = __builtin_shufflevector(v[0], v[1], 0, 3, 11, 0, 4, 12, 0, 5),
               c = __builtin_shufflevector(v[0], v[1], 13, 0, 6, 14, 0, 7, 15, 0);
  store8(rows, load8(rows) + __builtin_shufflevector(a, v[2], 0, 1, 8, 3, 4, 9, 6, 7));
  store8(rows + 8, load8(rows + 8) + __builtin_shufflevector(b, v[2], 10, 1, 2, 11, 4, 5, 12, 7));
  store8(rows + 16, load8(rows + 16) + __builtin_shufflevector(c, v[2], 0, 13, 2, 3, 14, 5, 6, 15));
}
template <>
inline void add_to_rows<4>(float* rows, const Float8* v) {
  const Float8 ab[2] = {__builtin_shufflevector(v[0], v[1], 0, 8, 1, 9, 2, 10, 3, 11),
                        __builtin_shufflevector(v[0], v[1], 4, 12, 5, 13, 6, 14, 7, 15)},
               cd[2] = {__builtin_shufflevector(v[2], v[3], 0, 8, 1, 9, 2, 10, 3, 11),
                        __builtin_shufflevector(v[2], v[3], 4, 12, 5, 13, 6, 14, 7, 15)};
  for (int half = 0; half < 2; ++half) {
    float* to = rows + 16 * half;
    store8(to, load8(to) + __builtin_shufflevector(ab[half], cd[half], 0, 1, 8, 9, 2, 3, 10, 11));
    store8(to + 8, load8(to + 8) + __builtin_shufflevector(ab[half], cd[half], 4, 5, 12, 13, 6, 7, 14, 15));
  }
}
/// Rows become columns.
static inline void transpose8(const Float8* rows, Float8* out) {
  Float8 pairs[8], quads[8];
  for (int i = 0; i < 8; i += 2) {
    pairs[i] = __builtin_shufflevector(rows[i], rows[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
    pairs[i + 1] = __builtin_shufflevector(rows[i], rows[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
  }
  for (int i = 0; i < 8; i += 4) {
    for (int k = 0; k < 2; ++k) {
      quads[i + 2 * k] = __builtin_shufflevector(pairs[i + k], pairs[i + 2 + k], 0, 1, 8, 9, 4, 5, 12, 13);
      quads[i + 2 * k + 1] = __builtin_shufflevector(pairs[i + k], pairs[i + 2 + k], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  }
  for (int k = 0; k < 4; ++k) {
    out[k] = __builtin_shufflevector(quads[k], quads[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    out[k + 4] = __builtin_shufflevector(quads[k], quads[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
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
  return (Float8)((Unsigned8)p + ((Unsigned8)rounded << 23));
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
