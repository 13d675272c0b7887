#pragma once

/// A graph network of structure-aware convolutions for one sample, without gradients: an actor that plays frame by
/// frame. Its layers are those of SAGCN (nets/sagcn.h):
///
///   x = SAGC_first(f)
///   blocks       x + SAGC(ELU(norm(SAGC(ELU(norm(x))))))
///   dense sum    x + b_k + s sum_l K_l ELU(norm(x_l)), before one of the blocks or after the last
///   f' = SAGC_last(ELU(x))
///
/// The values are those of the layers one after the other up to rounding, but the end of a convolution and the
/// beginning of the next are one pass over the nodes, and kernels lie in the order in which the passes read them.

#include <torch/types.h>

#include <optional>
#include <vector>

#include "doppel/layers/graph_convolution/graph_convolution.h"

namespace doppel {

/// How kernels are held for inference: as they were trained, or rounded to the 8 significant bits of bfloat16, which
/// halves what a frame reads from memory. Sums, biases, and the first and last convolution stay in float32.
enum class WeightFormat { float32, bfloat16 };

/// The format that the environment variable DOPPEL_WEIGHTS names, `float32` (the default) or `bfloat16`.
/// @throws UsageError for another value
WeightFormat inference_weights();

class GraphChain {
 public:
  /// The number of features between the layers. The last layer has at most as many outputs.
  static constexpr int64_t kFeatures = 16;

  struct Layer {
    torch::Tensor kernels, bias;  ///< float32 [K,Hin,Hout], [K,Hout]
    NodeNorm norm;                ///< before the ELU: running statistics, [K,Hin] or [Hin]; may be undefined
  };
  struct Layers {
    Layer first, last;
    std::vector<Layer> units;  ///< two per block
    std::optional<Layer> dense;
    double dense_scale = 1.0;     ///< s
    std::size_t dense_block = 0;  ///< the dense sum comes before this block
  };

  /// Copies the weights. @pre sizes as above
  GraphChain(const RingWeights& ring, const Layers& layers, WeightFormat format);

  /// @param features float32 [1,K,Hin] @return [1,K,Hout]
  torch::Tensor forward(const torch::Tensor& features) const;

 private:
  /// What comes after a sum over neighbours, in the order of RingWeights::order.
  struct Step {
    torch::Tensor bias;                    ///< [K,16] of the convolution whose sum this is
    torch::Tensor kernels;                 ///< of the next; undefined: none
    torch::Tensor norm_scale, norm_shift;  ///< [K,16] before it; undefined: none
    bool keeps = false;                    ///< whether x is needed later
    bool skips = false;                    ///< whether the x that was kept last is added
    bool is_dense = false;                 ///< the next is the dense sum
    bool after_dense = false;              ///< x is that which was kept, and the dense sum
  };

  void add_columns(const RingWeights& ring);
  torch::Tensor placed(const torch::Tensor& per_node) const;
  torch::Tensor placed_kernels(const torch::Tensor& kernels) const;
  Step step_before(const Layer& next) const;
  void plan_steps(const Layers& layers);
  torch::Tensor run_step(const Step& step, const torch::Tensor& products, torch::Tensor& kept,
                         torch::Tensor& common) const;

  WeightFormat format_;
  int64_t nodes_, rings_, outputs_;
  torch::Tensor order_;          ///< int32 [K]
  torch::Tensor order_index_;    ///< the same in int64
  torch::Tensor positions_;      ///< int64 [K]
  torch::Tensor columns_;        ///< int16 (read as unsigned) or int32 [E], ring by ring
  torch::Tensor begins_;         ///< int32 [K R + 1]
  torch::Tensor scales_;         ///< [K]
  torch::Tensor first_kernels_;  ///< [K,Hin,16]
  torch::Tensor last_kernels_;   ///< [K,Hout,16]
  torch::Tensor last_bias_;      ///< [K,16]
  std::vector<Step> steps_;
  double dense_scale_;
};

}  // namespace doppel
