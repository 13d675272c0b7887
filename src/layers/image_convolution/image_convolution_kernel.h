#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// Channels of one image. Strides are in floats; 0 where pixels share memory. Columns are contiguous or shared.
struct ImageChannels {
  const float* data;
  int64_t count;
  int64_t channel, row, column;  ///< strides
};

/// A convolution of one image (image_convolution.h).
struct ImageConvolutionParams {
  ImageChannels parts[2];  ///< the second with count 0: none
  int64_t height, width;   ///< of the image in memory, before it is enlarged
  int64_t out_height, out_width;
  int64_t outputs;
  int kernel;  ///< 3: stride 1; 4: stride 2
  bool enlarge;
  const float* weight;         ///< [outputs, inputs, kernel, kernel]
  const float *scale, *shift;  ///< [outputs], or null
  float slope;
  float* out;  ///< [outputs, out_height, out_width]
};

namespace kernels {

/// Floats of scratch memory that a block of `rows` output rows needs.
DOPPEL_DECLARE_KERNEL(int64_t, image_convolution_scratch, (const ImageConvolutionParams& p, int64_t rows))
/// The output channels [first,last) of the output rows [begin,end).
DOPPEL_DECLARE_KERNEL(void, image_convolution,
                      (const ImageConvolutionParams& p, int64_t begin, int64_t end, int64_t first, int64_t last,
                       float* scratch))

}  // namespace kernels
}  // namespace doppel
