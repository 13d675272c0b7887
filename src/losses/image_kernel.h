#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// One view of a loss between images (image_terms.h): rows [begin,end) of an image.
struct ImageLossParams {
  int64_t height, width;
  int measure;            ///< image_loss::Measure
  const float* rendered;  ///< [H,W,3]
  const float* target;    ///< [H,W,3]
  const uint8_t* mask;    ///< [H,W], 0 or 1
  const float* matrix;    ///< chroma: [2,3], times 255
  const float* taps;      ///< chroma: [half_size + 1], the middle tap first
  int half_size;
  float* scratch;   ///< image_loss_scratch floats
  double* sum;      ///< forward: the rows' part of the sum
  float scale;      ///< backward: dL/d(sum)
  float* gradient;  ///< backward: [H,W,3], to `rendered`; the gradient to `target` is its negative
};

namespace kernels {

/// The number of floats of scratch memory for a call with `rows` rows.
DOPPEL_DECLARE_KERNEL(int64_t, image_loss_scratch, (const ImageLossParams& p, int64_t rows))
DOPPEL_DECLARE_KERNEL(void, image_loss_forward, (const ImageLossParams& p, int64_t begin, int64_t end))
DOPPEL_DECLARE_KERNEL(void, image_loss_backward, (const ImageLossParams& p, int64_t begin, int64_t end))
/// One 3x3 erosion of [H,W] masks of 0 and 1, rows [begin,end). Pixels beyond the image count as 1.
DOPPEL_DECLARE_KERNEL(void, erode_rows,
                      (const uint8_t* from, int64_t height, int64_t width, int64_t begin, int64_t end, uint8_t* to))

}  // namespace kernels
}  // namespace doppel
