#pragma once

/// Batch normalisation of a batch that several ranks share: the mean and variance are those of the whole batch, as if
/// one rank had all rows.
///
///   y = w (x - mu) / sqrt(var + epsilon) + b,   mu, var over the rows and pixels of all ranks
///
/// Gradients: to x, w and b. That to x includes the way through mu and var, which again are sums over all ranks; those
/// to w and b are of this rank's rows, and are summed with all other gradients.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "doppel/distributed/ranks.h"

namespace doppel {

/// What a layer in evaluation mode, whose statistics are constants, needs to normalise as above.
struct SharedStatistics {
  torch::Tensor weight, bias;    ///< [C...], the same values; through them the gradient of mu and var reaches x
  torch::Tensor mean, variance;  ///< [C...] of the rows of all ranks
};

/// @param x float32, this rank's rows @param rows the dimensions of x over which the statistics are taken: {0, 2, 3} of
/// images [B,C,H,W], neighbouring ones otherwise, for instance {1} of features of nodes [K,B,H]
/// @param weight, bias [C...], the shape of x without `rows`
/// @param running_mean, running_var [C...], updated in place as `momentum` says, the same on all ranks
SharedStatistics share_statistics(const torch::Tensor& x, const std::vector<std::int64_t>& rows,
                                  const torch::Tensor& weight, const torch::Tensor& bias,
                                  const torch::Tensor& running_mean, const torch::Tensor& running_var, double momentum,
                                  double epsilon, Ranks& ranks);

/// A layer with statistics over a batch. Without ranks, or with one, the batch is this process's own.
class BatchStatistics {
 public:
  virtual ~BatchStatistics() = default;
  void share_among(Ranks* ranks) { ranks_ = ranks && ranks->several() ? ranks : nullptr; }
  /// Null: the batch is not shared.
  Ranks* ranks() const { return ranks_; }

 private:
  Ranks* ranks_ = nullptr;
};

/// Sets the ranks of all layers of a network with statistics over a batch. @param ranks null: not shared
void share_batch_statistics(torch::nn::Module& network, Ranks* ranks);
/// Whether the layers of a network share their batches.
bool shares_batch_statistics(const torch::nn::Module& network);

/// Batch normalisation of images, whose batch may be shared (float32 on the CPU then). Names of parameters and buffers,
/// and results, are those of torch::nn::BatchNorm2d, from which LibTorch lets no class derive.
class ImageNormImpl : public torch::nn::Module, public BatchStatistics {
 public:
  /// @param momentum running = (1 - momentum) running + momentum new @param epsilon is added to the variance
  explicit ImageNormImpl(std::int64_t channels, double epsilon = 1e-5, double momentum = 0.1);
  torch::Tensor forward(const torch::Tensor& images);  ///< [B,C,H,W]

  /// In evaluation mode the layer is scale * x + shift, both [C].
  struct Affine {
    torch::Tensor scale, shift;
  };
  Affine in_evaluation() const;

  torch::Tensor weight, bias, running_mean, running_var, num_batches_tracked;

 private:
  double epsilon_, momentum_;
};
TORCH_MODULE(ImageNorm);

}  // namespace doppel
