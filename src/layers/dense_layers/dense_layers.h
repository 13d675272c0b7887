#pragma once

/// The layers of a small network at many points, x' = max(W x + b, 0), without gradients. The last layer may be linear,
/// x' = W x + b.
///
/// A block of points passes through all layers while its values stay in the cache. With LibTorch's layers, the values
/// of all points are written and read again between two layers. Letters: P points.

#include <torch/types.h>

#include <utility>
#include <vector>

#include "doppel/layers/dense_layers/dense_layers_kernel.h"

namespace doppel {

enum class LastLayer { rectified, linear };

class DenseLayers {
 public:
  /// @param layers weight [out,in] and bias [out] of each layer, any float type, on the CPU; copied as float32
  /// @throws UsageError for shapes that do not follow each other
  explicit DenseLayers(const std::vector<std::pair<torch::Tensor, torch::Tensor>>& layers,
                       LastLayer last = LastLayer::rectified);

  /// Runs on the calling thread. @param points [count,in] @param out [count,out]
  void run(const float* points, int64_t count, float* out) const;

  int64_t inputs() const { return layers_.front().inputs; }
  int64_t outputs() const { return layers_.back().outputs; }

 private:
  /// The weights in panels of neighbouring outputs.
  struct Packed {
    torch::Tensor weight;  ///< [panels,inputs,panel width], rows beyond `outputs` are 0
    torch::Tensor bias;    ///< [panels * panel width]
  };
  std::vector<Packed> packed_;
  std::vector<DenseLayerParams> layers_;  ///< pointers to `packed_`
};

}  // namespace doppel
