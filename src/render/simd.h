#pragma once

// Vectors of the width of the instruction set that a kernel file is compiled for. For kernel files only (DOPPEL_ISA).
//
// Everything is in the namespace of the instruction set, so that the linker never mixes variants. Arithmetic uses GCC's
// vector types. Operations that they lack (rounding, masks, transposed loads) use intrinsics, or plain loops where an
// instruction set has none.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "doppel/core/vector_width.h"

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#endif

namespace doppel::kernels::DOPPEL_ISA {

constexpr int kLanes = kVectorBytes / sizeof(float);

typedef float Float4 __attribute__((vector_size(16)));
typedef float Float __attribute__((vector_size(4 * kLanes)));
typedef std::int32_t Int __attribute__((vector_size(4 * kLanes)));

static inline Float splat(float x) { return x - Float{}; }
static inline Int splat(std::int32_t x) { return x - Int{}; }

static inline Int lane_numbers() {
  Int v;
  for (int i = 0; i < kLanes; ++i) v[i] = i;
  return v;
}

template <typename V, typename T>
static inline V load(const T* p) {
  V v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
template <typename V, typename T>
static inline void store(T* p, const V& v) {
  std::memcpy(p, &v, sizeof v);
}

static inline Int min(Int a, Int b) { return a < b ? a : b; }
static inline Int max(Int a, Int b) { return a > b ? a : b; }
// If a is NaN, these return b. Pass limits as b.
static inline Float min(Float a, Float b) { return a < b ? a : b; }
static inline Float max(Float a, Float b) { return a > b ? a : b; }
static inline Float to_float(Int v) { return __builtin_convertvector(v, Float); }

/// To the nearest integer, halves to even, as std::lrintf does for the scalar paths.
static inline Int round_to_int(Float v) {
#if defined(__AVX512F__)
  return (Int)_mm512_cvtps_epi32((__m512)v);
#elif defined(__AVX2__)
  return (Int)_mm256_cvtps_epi32((__m256)v);
#elif defined(__SSE2__)
  return (Int)_mm_cvtps_epi32((__m128)v);
#else
  Int r;
  for (int i = 0; i < kLanes; ++i) r[i] = static_cast<std::int32_t>(std::lrintf(v[i]));
  return r;
#endif
}

static inline Float square_root(Float v) {
#if defined(__AVX512F__)
  return (Float)_mm512_sqrt_ps((__m512)v);
#elif defined(__AVX2__)
  return (Float)_mm256_sqrt_ps((__m256)v);
#elif defined(__SSE2__)
  return (Float)_mm_sqrt_ps((__m128)v);
#else
  for (int i = 0; i < kLanes; ++i) v[i] = std::sqrt(v[i]);
  return v;
#endif
}

// --- masks: one bit per lane in AVX-512, a lane of ones otherwise ----------------------------------------------------

#if defined(__AVX512F__)
typedef __mmask16 Mask;
static inline Mask mask_of(Int condition) { return _mm512_movepi32_mask((__m512i)condition); }
static inline Mask not_negative(Int v) { return static_cast<Mask>(~_mm512_movepi32_mask((__m512i)v)); }
static inline Mask greater(Float a, Float b) { return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_GT_OQ); }
static inline unsigned bits_of(Mask m) { return m; }
static inline Float choose(Mask m, Float a, Float b) { return (Float)_mm512_mask_blend_ps(m, (__m512)b, (__m512)a); }
static inline Int choose(Mask m, Int a, Int b) { return (Int)_mm512_mask_blend_epi32(m, (__m512i)b, (__m512i)a); }
#else
typedef Int Mask;
static inline Mask mask_of(Int condition) { return condition; }
static inline Mask not_negative(Int v) { return v >= 0; }
static inline Mask greater(Float a, Float b) { return a > b; }
static inline unsigned bits_of(Mask m) {
#if defined(__AVX2__)
  return static_cast<unsigned>(_mm256_movemask_ps((__m256)m));
#elif defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps((__m128)m));
#else
  unsigned bits = 0;
  for (int i = 0; i < kLanes; ++i) bits |= (m[i] < 0 ? 1u : 0u) << i;
  return bits;
#endif
}
static inline Float choose(Mask m, Float a, Float b) { return m ? a : b; }
static inline Int choose(Mask m, Int a, Int b) { return m ? a : b; }
#endif

// --- gathers of records of four floats -------------------------------------------------------------------------------

/// Loads four floats from `kStride * index[lane]` for each lane, one vector for each of the four.
template <int kStride>
static inline void load_quads(const float* records, const std::int32_t* index, Float& a, Float& b, Float& c, Float& d) {
#if defined(__AVX512F__)
  __m512 r[4];
  for (int i = 0; i < 4; ++i) {
    __m512 v = _mm512_castps128_ps512(_mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[i])));
    v = _mm512_insertf32x4(v, _mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[4 + i])), 1);
    v = _mm512_insertf32x4(v, _mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[8 + i])), 2);
    r[i] = _mm512_insertf32x4(v, _mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[12 + i])), 3);
  }
  const __m512 ab01 = _mm512_unpacklo_ps(r[0], r[1]), cd01 = _mm512_unpackhi_ps(r[0], r[1]);
  const __m512 ab23 = _mm512_unpacklo_ps(r[2], r[3]), cd23 = _mm512_unpackhi_ps(r[2], r[3]);
  a = (Float)_mm512_shuffle_ps(ab01, ab23, 0x44);
  b = (Float)_mm512_shuffle_ps(ab01, ab23, 0xEE);
  c = (Float)_mm512_shuffle_ps(cd01, cd23, 0x44);
  d = (Float)_mm512_shuffle_ps(cd01, cd23, 0xEE);
#elif defined(__AVX2__)
  __m256 r[4];
  for (int i = 0; i < 4; ++i) {
    const __m256 v = _mm256_castps128_ps256(_mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[i])));
    r[i] = _mm256_insertf128_ps(v, _mm_loadu_ps(records + kStride * static_cast<std::int64_t>(index[4 + i])), 1);
  }
  const __m256 ab01 = _mm256_unpacklo_ps(r[0], r[1]), cd01 = _mm256_unpackhi_ps(r[0], r[1]);
  const __m256 ab23 = _mm256_unpacklo_ps(r[2], r[3]), cd23 = _mm256_unpackhi_ps(r[2], r[3]);
  a = (Float)_mm256_shuffle_ps(ab01, ab23, 0x44);
  b = (Float)_mm256_shuffle_ps(ab01, ab23, 0xEE);
  c = (Float)_mm256_shuffle_ps(cd01, cd23, 0x44);
  d = (Float)_mm256_shuffle_ps(cd01, cd23, 0xEE);
#else
  for (int i = 0; i < kLanes; ++i) {
    const float* r = records + kStride * static_cast<std::int64_t>(index[i]);
    a[i] = r[0];
    b[i] = r[1];
    c[i] = r[2];
    d[i] = r[3];
  }
#endif
}

/// Components 0..3 of the records `index[lane]`, one vector each.
static inline void load_records(const float* records, const std::int32_t* index, Float& a, Float& b, Float& c,
                                Float& d) {
  load_quads<4>(records, index, a, b, c, d);
}

/// The first three of four integers of the records `index[lane]`.
static inline void load_corners(const std::int32_t* records, const std::int32_t* index,
                                std::int32_t (*corner)[kLanes]) {
#if defined(__AVX2__)
  Float a, b, c, unused;
  load_quads<4>(reinterpret_cast<const float*>(records), index, a, b, c, unused);  // moved, never computed with
  store(corner[0], a);
  store(corner[1], b);
  store(corner[2], c);
#else
  for (int lane = 0; lane < kLanes; ++lane) {
    const std::int32_t* record = records + 4 * static_cast<std::int64_t>(index[lane]);
    for (int k = 0; k < 3; ++k) corner[k][lane] = record[k];
  }
#endif
}

/// The reverse: stores a..d of lane 0, of lane 1, ... `out` [kLanes,4].
static inline void store_quads(float* out, Float a, Float b, Float c, Float d) {
#if defined(__AVX512F__)
  const __m512 ab01 = _mm512_unpacklo_ps((__m512)a, (__m512)b), ab23 = _mm512_unpackhi_ps((__m512)a, (__m512)b);
  const __m512 cd01 = _mm512_unpacklo_ps((__m512)c, (__m512)d), cd23 = _mm512_unpackhi_ps((__m512)c, (__m512)d);
  const __m512 r[4] = {_mm512_shuffle_ps(ab01, cd01, 0x44), _mm512_shuffle_ps(ab01, cd01, 0xEE),
                       _mm512_shuffle_ps(ab23, cd23, 0x44), _mm512_shuffle_ps(ab23, cd23, 0xEE)};
  for (int i = 0; i < 4; ++i) {
    _mm_storeu_ps(out + 4 * i, _mm512_castps512_ps128(r[i]));
    _mm_storeu_ps(out + 4 * (4 + i), _mm512_extractf32x4_ps(r[i], 1));
    _mm_storeu_ps(out + 4 * (8 + i), _mm512_extractf32x4_ps(r[i], 2));
    _mm_storeu_ps(out + 4 * (12 + i), _mm512_extractf32x4_ps(r[i], 3));
  }
#elif defined(__AVX2__)
  const __m256 ab01 = _mm256_unpacklo_ps((__m256)a, (__m256)b), ab23 = _mm256_unpackhi_ps((__m256)a, (__m256)b);
  const __m256 cd01 = _mm256_unpacklo_ps((__m256)c, (__m256)d), cd23 = _mm256_unpackhi_ps((__m256)c, (__m256)d);
  const __m256 r[4] = {_mm256_shuffle_ps(ab01, cd01, 0x44), _mm256_shuffle_ps(ab01, cd01, 0xEE),
                       _mm256_shuffle_ps(ab23, cd23, 0x44), _mm256_shuffle_ps(ab23, cd23, 0xEE)};
  for (int i = 0; i < 4; ++i) {
    _mm_storeu_ps(out + 4 * i, _mm256_castps256_ps128(r[i]));
    _mm_storeu_ps(out + 4 * (4 + i), _mm256_extractf128_ps(r[i], 1));
  }
#else
  for (int i = 0; i < kLanes; ++i) {
    out[4 * i] = a[i];
    out[4 * i + 1] = b[i];
    out[4 * i + 2] = c[i];
    out[4 * i + 3] = d[i];
  }
#endif
}

// --- images --------------------------------------------------------------------------------------------------------

#if defined(__AVX512F__)
/// b0 b1 b2 of lane 0, of lane 1, ...
static inline void store_interleaved(float* out, const Float* b) {
  alignas(64) static const std::int32_t kFirst[3][16] = {{0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5},
                                                         {21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26},
                                                         {0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0}};
  alignas(64) static const std::int32_t kSecond[3][16] = {{0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15},
                                                          {0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15},
                                                          {26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31}};
  for (int k = 0; k < 3; ++k) {
    const __m512 two = _mm512_permutex2var_ps((__m512)b[0], _mm512_load_si512(kFirst[k]), (__m512)b[1]);
    _mm512_storeu_ps(out + 16 * k, _mm512_permutex2var_ps(two, _mm512_load_si512(kSecond[k]), (__m512)b[2]));
  }
}
#elif defined(__AVX2__)
static inline void store_interleaved(float* out, const Float* b) {
  // Lane i of b[k] goes to 3 i + k. Its position within a vector of eight differs from those of the other lanes, so one
  // permutation serves all three vectors that are stored.
  const __m256 x = _mm256_permutevar8x32_ps((__m256)b[0], _mm256_setr_epi32(0, 3, 6, 1, 4, 7, 2, 5));
  const __m256 y = _mm256_permutevar8x32_ps((__m256)b[1], _mm256_setr_epi32(5, 0, 3, 6, 1, 4, 7, 2));
  const __m256 z = _mm256_permutevar8x32_ps((__m256)b[2], _mm256_setr_epi32(2, 5, 0, 3, 6, 1, 4, 7));
  _mm256_storeu_ps(out, _mm256_blend_ps(_mm256_blend_ps(x, y, 0x92), z, 0x24));
  _mm256_storeu_ps(out + 8, _mm256_blend_ps(_mm256_blend_ps(x, y, 0x24), z, 0x49));
  _mm256_storeu_ps(out + 16, _mm256_blend_ps(_mm256_blend_ps(x, y, 0x49), z, 0x92));
}
#else
static inline void store_interleaved(float* out, const Float* b) {
  alignas(64) float rows[3][kLanes];
  for (int k = 0; k < 3; ++k) store(rows[k], b[k]);
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int k = 0; k < 3; ++k) out[3 * lane + k] = rows[k][lane];
  }
}
#endif

}  // namespace doppel::kernels::DOPPEL_ISA
