#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

constexpr int kSsimWindow = 11;
constexpr double kSsimC1 = 0.01 * 0.01, kSsimC2 = 0.03 * 0.03;  ///< for colours 0..1
constexpr int kSsimStrip = 32;                                  ///< rows of windows at a time
constexpr int kSsimRows = kSsimStrip + kSsimWindow - 1;         ///< of pixels
constexpr int kSsimMoments = 5;                                 ///< of a, b, aa, bb, ab

/// A strip of windows of two images [H,W,3].
struct SimilarityStrip {
  const float *a, *b;
  std::int64_t width;           ///< of the images, pixels
  std::int64_t x0, x1, y0, y1;  ///< upper left pixels of the windows; x1, y1 excluded, y1 - y0 <= kSsimStrip
  const float* weights;         ///< [kSsimWindow]
  float* gradient;              ///< [H,W,3]: the gradient of the sum of similarities to `a` is added; null: not wanted
  /// Memory for kSsimMoments moments of kSsimRows rows of pixels and of kSsimStrip rows of windows, and for three rows.
  float* scratch;
};
/// @return the sum of the similarities of the windows and channels
DOPPEL_DECLARE_KERNEL(double, similarity_strip, (const SimilarityStrip& strip))

}  // namespace doppel::kernels
