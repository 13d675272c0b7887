#pragma once

/// The structure-aware graph convolutional network (6.5.3): stem SAGC, L residual blocks of (BN, ELU, SAGC) x 2 with a
/// skip connection, a dense block between the halves, head (ELU, SAGC).

#include <torch/nn/cloneable.h>
#include <torch/nn/modules/container/modulelist.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <string>

#include "doppel/core/config.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"

namespace doppel {

/// What batch normalisation shares: nothing (each node and feature on its own), all nodes, or there is none.
enum class SagcnNorm { node, channel, none };
/// How far nodes talk to each other: not at all, the broadcast sum of 6.5.3, or a learned K x K matrix.
enum class DenseBlock { none, broadcast, matrix };
/// Glorot uniform per node with a small head, or everything near 1e-3 as in the public code.
enum class SagcnInitialisation { glorot, public_code };

struct SagcnConfig {
  int features = 16;         ///< H_1
  int residual_blocks = 8;   ///< L, even
  int rings = 3;             ///< R of 6.6
  SagcnNorm norm = SagcnNorm::node;
  double norm_momentum = 0.003;
  double norm_epsilon = 1e-5;
  DenseBlock dense = DenseBlock::none;
  bool dense_normalised = true;  ///< broadcast: divide the sum by K (1/K is 6.6 for equal weights)
  SagcnInitialisation initialisation = SagcnInitialisation::glorot;
  double head_scale = 1e-3;      ///< bound of the uniform head kernels: first outputs are about 0

  /// Reads the keys above over `defaults`. @throws FileError at the key
  static SagcnConfig read(const ConfigReader& reader, const SagcnConfig& defaults);
  /// @throws UsageError listing every fault
  void check() const;
};

/// One (norm, ELU, SAGC).
class SagcnUnitImpl : public torch::nn::Module {
 public:
  SagcnUnitImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config);

  torch::Tensor forward_node_major(const torch::Tensor& features, const torch::Tensor& skip);
  torch::Tensor forward_reference(const torch::Tensor& features);

  GraphConvolution convolution{nullptr};
  torch::Tensor norm_weight, norm_bias, running_mean, running_var;

 private:
  NodeNorm node_norm() const;
  torch::Tensor channel_norm(const torch::Tensor& features, int64_t nodes_axis);
  SagcnNorm norm_;
  double momentum_, epsilon_;
};
TORCH_MODULE(SagcnUnit);

class SagcnImpl : public torch::nn::Module {
 public:
  /// @param inputs  Hin of the stem  @param outputs Hout of the head
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  SagcnImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config,
            std::optional<at::Generator> generator = std::nullopt);

  /// @param features [B,K,Hin] @return [B,K,Hout]
  /// @throws Error in training with norm = node and B = 1, where every normalised feature would be 0
  torch::Tensor forward(const torch::Tensor& features);
  /// The same in plain tensor operations only (export, double, other devices).
  torch::Tensor forward_reference(const torch::Tensor& features);

  const SagcnConfig& config() const { return config_; }

 private:
  void initialise(at::Generator generator);
  torch::Tensor dense_block(const torch::Tensor& features);
  void check_batch(const torch::Tensor& features) const;

  SagcnConfig config_;
  int64_t num_nodes_;
  int inputs_, outputs_;
  GraphConvolution stem_{nullptr}, head_{nullptr};
  torch::nn::ModuleList units_;      // two per residual block
  torch::Tensor dense_kernels_, dense_bias_, dense_norm_weight_, dense_norm_bias_, dense_running_mean_,
      dense_running_var_;
};
TORCH_MODULE(Sagcn);

}  // namespace doppel
