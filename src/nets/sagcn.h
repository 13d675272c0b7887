#pragma once

/// The structure-aware graph convolutional network, SAGCN (6.5.3). SAGC is the structure-aware graph convolution of 6.5
/// (graph_convolution.h). BN is batch normalisation. The layers, in this order:
///
///   stem            SAGC, Hin to H_1 features per node
///   L blocks        x + SAGC(ELU(BN(SAGC(ELU(BN(x))))))
///   dense block     after the first L/2 blocks, if configured (DenseUnit)
///   head            ELU, then SAGC, H_1 to Hout features per node
///
/// Shapes: B batch, K nodes, H features per node. The public layout is [B,K,H]. The layout of the fused kernels is
/// node-major, [K,B,H]. Functions whose names end in `_node_major` take and return the second one.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/nets/graph_chain.h"
#include "doppel/nets/graph_network.h"
#include "doppel/nets/shared_norm.h"

namespace doppel {

/// The batch normalisation. `node`: statistics and parameters for each node and feature. `channel`: for each feature,
/// common to all nodes. `none`: no normalisation.
enum class SagcnNorm { node, channel, none };
/// The dense block, in which every node receives features of all nodes. `none`: no dense block. `broadcast`: the sum
/// over all nodes of 6.5.3 (`dense_broadcast`). `matrix`: a learned matrix [K,K], the same for all features
/// (`dense_matrix`).
enum class DenseBlock { none, broadcast, matrix };
/// The initial weights. `glorot`: the kernels of a node are uniform in +-sqrt(6 / (inputs + outputs)). In the head and
/// in the dense block, they are uniform in +-head_scale instead. Biases are 0. `public_code`: kernels and biases are
/// normal with mean -1e-3 and standard deviation 1e-3, as in the public code. In the dense block, the kernels are a
/// hundredth of that, and the bias is 0.
enum class SagcnInitialisation { glorot, public_code };

struct SagcnConfig {
  int features = 16;        ///< H_1, features per node between stem and head
  int residual_blocks = 8;  ///< L, even; 0: none
  int rings = 3;            ///< R of 6.6, for the caller who builds the RingWeights; SagcnImpl does not read it
  SagcnNorm norm = SagcnNorm::node;
  double norm_momentum = 0.003;  ///< running = (1 - momentum) running + momentum new
  double norm_epsilon = 1e-5;    ///< added to the variance
  DenseBlock dense = DenseBlock::none;
  bool dense_normalised = true;  ///< `broadcast` only: divides the sum by K, as 6.6 does for equal weights
  SagcnInitialisation initialisation = SagcnInitialisation::glorot;
  double head_scale = 1e-3;  ///< `glorot` only: bound of the kernels of head and dense block. A small bound makes the
                             ///< initial outputs about 0.

  /// Checks the numbers. @throws UsageError that lists every value out of range
  void check() const;
};
void describe_keys(const Keys& keys, SagcnConfig& config);

/// The batch normalisation that SagcnNorm selects. In training mode it uses the statistics of the batch, which may be
/// shared by ranks, and updates the running ones. In evaluation mode it uses the running ones.
class FeatureNormImpl : public torch::nn::Module, public BatchStatistics {
 public:
  FeatureNormImpl(int64_t num_nodes, int features, const SagcnConfig& config);

  /// Plain tensor operations. `none` returns the input. @param features [B,K,H] @return [B,K,H]
  torch::Tensor forward(const torch::Tensor& features);
  /// Parameters and statistics in the form that the fused convolution takes. For `channel` and `none` the tensors of
  /// the result are undefined, and the fused convolution does not normalise. While ranks share the batch, the
  /// statistics are those of the features on all ranks. @param features [K,B,H] with batch_dimension 1, or [B,K,H] with
  /// 0
  NodeNorm node_norm(const torch::Tensor& features, int64_t batch_dimension) const;
  /// The running statistics; undefined for `none`.
  NodeNorm running() const;
  SagcnNorm kind() const { return kind_; }

  torch::Tensor weight, bias, running_mean, running_var;  ///< `node`: [K,H]; `channel`: [H]; `none`: undefined

 private:
  /// Whether the statistics are those of a batch that ranks share.
  bool is_shared() const { return ranks() && is_training(); }

  SagcnNorm kind_;
  double momentum_, epsilon_;
};
TORCH_MODULE(FeatureNorm);

/// Half a residual block without its skip connection: batch normalisation, ELU, SAGC.
class SagcnUnitImpl : public torch::nn::Module {
 public:
  SagcnUnitImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config);

  /// @param features [K,B,Hin] @param skip [K,B,Hout], added to the result; undefined: nothing is added
  /// @return [K,B,Hout]
  torch::Tensor forward_node_major(const torch::Tensor& features, const torch::Tensor& skip = {});
  /// Plain tensor operations. @param features [B,K,Hin] @return [B,K,Hout]
  torch::Tensor forward_reference(const torch::Tensor& features);

  FeatureNorm norm{nullptr};
  GraphConvolution convolution{nullptr};
};
TORCH_MODULE(SagcnUnit);

/// The dense block in the middle of the network: features + dense(ELU(BN(features))). H is SagcnConfig::features.
class DenseUnitImpl : public torch::nn::Module {
 public:
  /// Kernels and bias start at 0; SagcnImpl initialises the kernels. @pre config.dense is not `none`
  DenseUnitImpl(int64_t num_nodes, const SagcnConfig& config);

  /// Plain tensor operations. @param features [B,K,H] @return [B,K,H]
  torch::Tensor forward(const torch::Tensor& features);
  /// @param features [K,B,H] @return [K,B,H]
  torch::Tensor forward_node_major(const torch::Tensor& features);

  DenseBlock kind() const { return kind_; }
  double scale() const { return scale_; }

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
  /// @param ring weights of the neighbours, from a graph with the K nodes of the features
  /// @param inputs Hin of the stem @param outputs Hout of the head
  /// @param generator draws the initial weights; by default a new generator with a fixed seed
  /// @throws UsageError as SagcnConfig::check
  SagcnImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config,
            std::optional<at::Generator> generator = std::nullopt);

  /// float32 on the CPU runs the fused kernels. Everything else, and a torch::jit trace, runs `forward_reference`.
  /// @param features [B,K,Hin] @return [B,K,Hout]
  /// @throws UsageError for another shape; in training mode also for `SagcnNorm::node` with B = 1, because every
  /// normalised feature would be 0
  torch::Tensor forward(const torch::Tensor& features) override;
  /// The same in plain tensor operations, for export, float64 and other devices. Can be traced.
  torch::Tensor forward_reference(const torch::Tensor& features);

  /// From now on, `forward` of one sample in evaluation mode without gradients runs a GraphChain, which copies the
  /// weights at its first use. They must not change afterwards. Networks that a GraphChain cannot run (other than 16
  /// features, more than 16 outputs, `dense: matrix`) stay as they are.
  void freeze(WeightFormat format);

  const SagcnConfig& config() const { return config_; }

 private:
  /// The network for one sample, made when it is first used, by whichever thread that is.
  struct Frozen {
    WeightFormat format;
    std::once_flag once{};
    std::unique_ptr<const GraphChain> chain{};
  };
  bool runs_frozen(const torch::Tensor& features) const;
  GraphChain::Layers chain_layers() const;
  void initialise(at::Generator generator);
  void check_input(const torch::Tensor& features) const;
  bool dense_follows(int block) const;

  SagcnConfig config_;
  int64_t num_nodes_;
  int inputs_;
  GraphConvolution stem_{nullptr}, head_{nullptr};
  std::vector<SagcnUnit> units_;  // two per residual block
  DenseUnit dense_{nullptr};
  std::shared_ptr<Frozen> frozen_;  // null: not frozen
};
TORCH_MODULE(Sagcn);

/// Freezes every SAGCN inside a module (SagcnImpl::freeze). @pre the module is in evaluation mode
void freeze_graph_networks(torch::nn::Module& module, WeightFormat format);

}  // namespace doppel
