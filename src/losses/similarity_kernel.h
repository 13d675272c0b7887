#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

constexpr int kSsimWindow = 11;
constexpr int kSsimStrip = 32;  ///< rows of windows at a time

/// A strip of windows of two images [H,W,3].
struct SimilarityStrip {
  const float *a, *b;
  std::int64_t width;           ///< of the images, pixels
  std::int64_t x0, x1, y0, y1;  ///< upper left pixels of the windows; x1, y1 excluded, y1 - y0 <= kSsimStrip
  const float* weights;         ///< [kSsimWindow]
  float* gradient;              ///< [H,W,3]: the gradient of the sum of similarities to `a` is added; null: not wanted
  float* scratch;               ///< similarity_scratch(x1 - x0) floats
};
/// @param columns of windows
DOPPEL_DECLARE_KERNEL(std::int64_t, similarity_scratch, (std::int64_t columns))
/// @return the sum of the similarities of the windows and channels
DOPPEL_DECLARE_KERNEL(double, similarity_strip, (const SimilarityStrip& strip))

}  // namespace doppel::kernels
