#pragma once

/// For kernel files only: vectors of floats whose lanes are items of the batch.
///
/// A layer's constants (weights, influences) are the same for every item of a batch. A kernel that puts L items side by
/// side therefore reads the constants once, as scalars, and never gathers: the values of a bone or node are a
/// contiguous load of L floats. Lanes beyond the batch repeat its last item. They are harmless, because lanes never
/// mix.
///
/// Everything is in the namespace of the instruction set that the file is compiled for.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "doppel/core/vector_width.h"

#if !defined(DOPPEL_ISA)
#error "lanes.h is for kernel files"
#endif

namespace doppel::kernels::DOPPEL_ISA {

template <int L>
struct LaneTypes {
  typedef float Vector __attribute__((vector_size(L * sizeof(float))));
  typedef int32_t Mask __attribute__((vector_size(L * sizeof(int32_t))));
};
template <int L>
using Vector = typename LaneTypes<L>::Vector;

/// The widest useful number of lanes for this instruction set.
constexpr int kMaxLanes = kVectorBytes / sizeof(float);

/// The number of lanes for `count` remaining items: the smallest of 4, 8 and 16 that holds them, at most kMaxLanes.
inline int lanes_for(int64_t count) {
  int lanes = 4;
  while (lanes < kMaxLanes && lanes < count) lanes *= 2;
  return lanes;
}

template <int L>
struct LaneCount {
  static constexpr int value = L;
};

/// Calls work(LaneCount<lanes>{}). Widths that this instruction set lacks are not compiled.
template <typename Work>
inline void with_lanes(int lanes, const Work& work) {
  if constexpr (kMaxLanes >= 16) {
    if (lanes == 16) return work(LaneCount<16>{});
  }
  if constexpr (kMaxLanes >= 8) {
    if (lanes == 8) return work(LaneCount<8>{});
  }
  work(LaneCount<4>{});
}

template <int L>
inline Vector<L> load(const float* from) {
  Vector<L> value;
  std::memcpy(&value, from, sizeof(value));
  return value;
}
template <int L>
inline void store(float* to, Vector<L> value) {
  std::memcpy(to, &value, sizeof(value));
}
template <int L>
inline Vector<L> broadcast(float value) {
  return value - Vector<L>{};
}

using Quad = Vector<4>;
#if defined(__clang__)
#define DOPPEL_SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define DOPPEL_SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, LaneTypes<4>::Mask{i, j, k, l})
#endif

inline void transpose(Quad& a, Quad& b, Quad& c, Quad& d) {
  const Quad ab_low = DOPPEL_SHUFFLE(a, b, 0, 4, 1, 5), ab_high = DOPPEL_SHUFFLE(a, b, 2, 6, 3, 7);
  const Quad cd_low = DOPPEL_SHUFFLE(c, d, 0, 4, 1, 5), cd_high = DOPPEL_SHUFFLE(c, d, 2, 6, 3, 7);
  a = DOPPEL_SHUFFLE(ab_low, cd_low, 0, 1, 4, 5);
  b = DOPPEL_SHUFFLE(ab_low, cd_low, 2, 3, 6, 7);
  c = DOPPEL_SHUFFLE(ab_high, cd_high, 0, 1, 4, 5);
  d = DOPPEL_SHUFFLE(ab_high, cd_high, 2, 3, 6, 7);
}
#undef DOPPEL_SHUFFLE

/// items[lane * stride + f] -> lanes[f * L + lane] for f < n; lanes >= count repeat item count-1.
template <int L>
inline void to_lanes(const float* items, int64_t stride, int count, int n, float* lanes) {
  for (int lane = 0; lane < L; lane += 4) {
    const float* row[4];
    for (int r = 0; r < 4; ++r) row[r] = items + (lane + r < count ? lane + r : count - 1) * stride;
    int f = 0;
    for (; f + 4 <= n; f += 4) {
      Quad a = load<4>(row[0] + f), b = load<4>(row[1] + f), c = load<4>(row[2] + f), d = load<4>(row[3] + f);
      transpose(a, b, c, d);
      float* to = lanes + f * L + lane;
      store<4>(to, a);
      store<4>(to + L, b);
      store<4>(to + 2 * L, c);
      store<4>(to + 3 * L, d);
    }
    for (; f < n; ++f) {
      for (int r = 0; r < 4; ++r) lanes[f * L + lane + r] = row[r][f];
    }
  }
}

/// The reverse. Lanes >= count are dropped.
template <int L>
inline void from_lanes(const float* lanes, int n, float* items, int64_t stride, int count) {
  for (int lane = 0; lane < count; lane += 4) {
    const int rows = count - lane < 4 ? count - lane : 4;
    int f = 0;
    for (; f + 4 <= n; f += 4) {
      const float* from = lanes + f * L + lane;
      Quad a = load<4>(from), b = load<4>(from + L), c = load<4>(from + 2 * L), d = load<4>(from + 3 * L);
      transpose(a, b, c, d);
      float* to = items + lane * stride + f;
      store<4>(to, a);
      if (rows > 1) store<4>(to + stride, b);
      if (rows > 2) store<4>(to + 2 * stride, c);
      if (rows > 3) store<4>(to + 3 * stride, d);
    }
    for (; f < n; ++f) {
      for (int r = 0; r < rows; ++r) items[(lane + r) * stride + f] = lanes[f * L + lane + r];
    }
  }
}

/// Sine and cosine of L angles, within 1e-7. Angles too large for the range reduction use the library's functions.
template <int L>
inline void sine_cosine(Vector<L> angle, Vector<L>* sine, Vector<L>* cosine) {
  constexpr float kReach = 8192.0f;
  float lanes[L], sines[L], cosines[L];
  store<L>(lanes, angle);
  bool reached = true;
  for (int l = 0; l < L; ++l) reached = reached && std::fabs(lanes[l]) <= kReach;  // false for NaN
  if (!reached) {
    for (int l = 0; l < L; ++l) {
      sines[l] = std::sin(lanes[l]);
      cosines[l] = std::cos(lanes[l]);
    }
    *sine = load<L>(sines);
    *cosine = load<L>(cosines);
    return;
  }
  // angle = quadrant * pi/2 + r, |r| <= pi/4; pi/2 in three parts whose products with the quadrant are exact.
  const float kTwoOverPi = 0.636619772f, kMagic = 12582912.0f;  // 1.5 * 2^23: adding it rounds to an integer
  const Vector<L> shifted = angle * kTwoOverPi + kMagic;
  const Vector<L> quadrant = shifted - kMagic;
  Vector<L> r = angle - quadrant * 1.5703125f;
  r = r - quadrant * 4.83751296997e-4f;
  r = r - quadrant * 7.54978995489e-8f;
  const Vector<L> r2 = r * r;
  // Minimax polynomials on [-pi/4, pi/4].
  const Vector<L> s = r + r * r2 * (-1.6666654611e-1f + r2 * (8.3321608736e-3f + r2 * -1.9515295891e-4f));
  const Vector<L> c =
      1.0f - 0.5f * r2 + r2 * r2 * (4.166664568298827e-2f + r2 * (-1.388731625493765e-3f + r2 * 2.443315711809948e-5f));
  typename LaneTypes<L>::Mask bits;
  std::memcpy(&bits, &shifted, sizeof(bits));
  const auto odd = (bits & 1) != 0;
  const auto negative_sine = (bits & 2) != 0, negative_cosine = ((bits + 1) & 2) != 0;
  const Vector<L> swapped_sine = odd ? c : s, swapped_cosine = odd ? s : c;
  *sine = negative_sine ? -swapped_sine : swapped_sine;
  *cosine = negative_cosine ? -swapped_cosine : swapped_cosine;
}

}  // namespace doppel::kernels::DOPPEL_ISA
