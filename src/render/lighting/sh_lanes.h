#pragma once

// Lighting by spherical harmonics (6.12), for vectors of pixels. For kernel files only.

#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {

/// The basis of sh_lighting.h. @param n unit normal @param sh [9]
static inline void basis(const Float* n, Float* sh) {
  sh[0] = splat(1.0f);
  sh[1] = n[1];
  sh[2] = n[2];
  sh[3] = n[0];
  sh[4] = n[0] * n[1];
  sh[5] = n[1] * n[2];
  sh[6] = 3.0f * n[2] * n[2] - 1.0f;
  sh[7] = n[0] * n[2];
  sh[8] = n[0] * n[0] - n[1] * n[1];
}

/// @param lighting [3,9] @param light of the three channels
static inline void illuminate(const float* lighting, const Float* sh, Float* light) {
  for (int c = 0; c < 3; ++c) {
    const float* l = lighting + 9 * c;
    Float sum = splat(l[0]);
    for (int j = 1; j < 9; ++j) sum += l[j] * sh[j];
    light[c] = sum;
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
