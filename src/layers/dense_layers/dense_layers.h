#pragma once

/// The layers of a small network at many points, x' = max(W x + b, 0), without gradients.
///
/// A block of points passes through all layers while its values stay in the cache. With LibTorch's layers, the values of
/// all points are written and read again between two layers. Letters: P points.

#include <torch/types.h>

#include <utility>
#include <vector>

namespace doppel {

class DenseLayers {
 public:
  /// @param layers weight [out,in] and bias [out] of each layer, float32 on the CPU; copied
  /// @throws UsageError for shapes that do not follow each other
  explicit DenseLayers(const std::vector<std::pair<torch::Tensor, torch::Tensor>>& layers);

  /// @param points float32 [P,in] @return [P,out]
  /// @throws UsageError for another shape
  torch::Tensor forward(const torch::Tensor& points) const;

 private:
  struct Layer {
    int64_t inputs, outputs;
    torch::Tensor weight;  ///< [panels,inputs,panel width], rows beyond `outputs` are 0
    torch::Tensor bias;    ///< [panels * panel width]
  };
  std::vector<Layer> layers_;
};

}  // namespace doppel
