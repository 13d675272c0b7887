#pragma once

/// The structure-aware graph convolutional network (6.5.3): stem SAGC, L residual blocks of (BN, ELU, SAGC) x 2 with a
/// skip connection, a dense block between the halves, head (ELU, SAGC).

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/nets/graph_network.h"

namespace doppel {

/// The sharing of batch normalisation: per node and feature, per feature over all nodes, or no normalisation.
enum class SagcnNorm { node, channel, none };
/// The exchange between all nodes: none, the broadcast sum of 6.5.3, or a learned K x K matrix.
enum class DenseBlock { none, broadcast, matrix };
/// Glorot uniform per node with a small head, or all weights near 1e-3 as in the public code.
enum class SagcnInitialisation { glorot, public_code };

struct SagcnConfig {
  int features = 16;        ///< H_1
  int residual_blocks = 8;  ///< L, even
  int rings = 3;            ///< R of 6.6
  SagcnNorm norm = SagcnNorm::node;
  double norm_momentum = 0.003;
  double norm_epsilon = 1e-5;
  DenseBlock dense = DenseBlock::none;
  bool dense_normalised = true;  ///< broadcast: divide the sum by K (1/K is 6.6 for equal weights)
  SagcnInitialisation initialisation = SagcnInitialisation::glorot;
  double head_scale = 1e-3;  ///< bound of the uniform head kernels: initial outputs are about 0

  /// Reads the keys above over `defaults`. @throws FileError at the key
  static SagcnConfig read(const ConfigReader& reader, const SagcnConfig& defaults);
  /// @throws UsageError listing every fault
  void check() const;
};

/// Batch normalisation according to SagcnNorm; `none` returns the input.
class FeatureNormImpl : public torch::nn::Module {
 public:
  FeatureNormImpl(int64_t num_nodes, int features, const SagcnConfig& config);

  /// Plain tensor operations. @param features [B,K,H] @return the same shape
  torch::Tensor forward(const torch::Tensor& features);
  /// The normalisation as input of the fused convolution; undefined unless the kind is `node`.
  NodeNorm node_norm() const;
  SagcnNorm kind() const { return kind_; }

  torch::Tensor weight, bias, running_mean, running_var;  ///< [K,H] or [H]

 private:
  SagcnNorm kind_;
  double momentum_, epsilon_;
};
TORCH_MODULE(FeatureNorm);

/// One (norm, ELU, SAGC).
class SagcnUnitImpl : public torch::nn::Module {
 public:
  SagcnUnitImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config);

  /// @param features [K,B,Hin] @param skip [K,B,Hout], added to the result, or undefined @return [K,B,Hout]
  torch::Tensor forward_node_major(const torch::Tensor& features, const torch::Tensor& skip = {});
  /// @param features [B,K,Hin] @return [B,K,Hout]
  torch::Tensor forward_reference(const torch::Tensor& features);

  FeatureNorm norm{nullptr};
  GraphConvolution convolution{nullptr};
};
TORCH_MODULE(SagcnUnit);

/// The dense block between the halves: features + dense(ELU(norm(features))).
class DenseUnitImpl : public torch::nn::Module {
 public:
  DenseUnitImpl(int64_t num_nodes, const SagcnConfig& config);

  /// @param features [B,K,H] @return [B,K,H]
  torch::Tensor forward(const torch::Tensor& features);
  /// @param features [K,B,H] @return [K,B,H]
  torch::Tensor forward_node_major(const torch::Tensor& features);

  FeatureNorm norm{nullptr};
  torch::Tensor kernels;  ///< [K,H,H] for `broadcast`, the matrix [K,K] for `matrix`
  torch::Tensor bias;     ///< [K,H]

 private:
  DenseBlock kind_;
  double scale_;
};
TORCH_MODULE(DenseUnit);

class SagcnImpl : public GraphNetwork {
 public:
  /// @param inputs  Hin of the stem  @param outputs Hout of the head
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  SagcnImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config,
            std::optional<at::Generator> generator = std::nullopt);

  /// @param features [B,K,Hin] @return [B,K,Hout]
  /// @throws Error in training with norm = node and B = 1, where every normalised feature would be 0
  torch::Tensor forward(const torch::Tensor& features) override;
  /// The same in plain tensor operations only (export, double, other devices).
  torch::Tensor forward_reference(const torch::Tensor& features);

  const SagcnConfig& config() const { return config_; }

 private:
  void initialise(at::Generator generator);
  void check_input(const torch::Tensor& features) const;
  bool dense_follows(int block) const;

  SagcnConfig config_;
  int64_t num_nodes_;
  int inputs_;
  GraphConvolution stem_{nullptr}, head_{nullptr};
  std::vector<SagcnUnit> units_;  // two per residual block
  DenseUnit dense_{nullptr};
};
TORCH_MODULE(Sagcn);

}  // namespace doppel
