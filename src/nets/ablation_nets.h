#pragma once

/// The baselines of Table 6.4 that replace the structure-aware network, and the choice between all three.

#include <torch/nn/module.h>
#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <memory>
#include <optional>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/geometry/topology.h"
#include "doppel/nets/graph_network.h"
#include "doppel/nets/sagcn.h"

namespace doppel {

/// Sizes that only the baselines have.
struct AblationConfig {
  int fully_connected_layers = 19;  ///< the depth of the graph network: stem, 16 units, dense block, head
  int fully_connected_width = 256;
  int chebyshev_order = 3;  ///< polynomials T_0 .. T_(order-1): the neighbourhood of R = 3 rings

  /// @throws UsageError listing every fault
  void check() const;
};
void describe_keys(const Keys& keys, AblationConfig& config);

/// Fully connected layers with ELU between them. The input is the normalised motion as one vector.
class FullyConnectedImpl : public GraphNetwork {
 public:
  /// @param inputs numbers in the motion window @param nodes, outputs the shape of the result
  /// @param head_scale bound of the last layer's initial weights: initial outputs are about 0
  FullyConnectedImpl(int64_t inputs, int64_t nodes, int64_t outputs, const AblationConfig& config, double head_scale,
                     at::Generator generator);

  /// @param features [B,1,Hin] @return [B,K,Hout]
  torch::Tensor forward(const torch::Tensor& features) override;

 private:
  int64_t inputs_, nodes_, outputs_;
  std::vector<torch::nn::Linear> layers_;
};
TORCH_MODULE(FullyConnected);

/// The rescaled Laplacian of a graph, 2 L / lambda_max - I with L = I - D^-1/2 A D^-1/2 and lambda_max = 2, which is
/// -D^-1/2 A D^-1/2. Rows are padded to the longest row; the row of a node without neighbours is empty.
struct RescaledLaplacian {
  explicit RescaledLaplacian(const MeshTopology& topology);
  /// @param features [K,M] @return [K,M]; symmetric, so the backward pass is the same product
  torch::Tensor multiply(const torch::Tensor& features) const;

  int64_t num_nodes = 0;
  torch::Tensor neighbours;  ///< int64 [K,P]
  torch::Tensor weights;     ///< float64 [K,P]
};

/// Graph convolution with weights shared by all nodes (Defferrard et al. 2016): f' = b + sum_m T_m(L) f W_m.
class ChebyshevConvolutionImpl : public torch::nn::Module {
 public:
  ChebyshevConvolutionImpl(std::shared_ptr<const RescaledLaplacian> laplacian, int64_t inputs, int64_t outputs,
                           int order);

  /// @param features [B,K,Hin] @return [B,K,Hout]
  torch::Tensor forward(const torch::Tensor& features);

  torch::Tensor weight;  ///< [order,Hin,Hout]
  torch::Tensor bias;    ///< [Hout]

 private:
  std::shared_ptr<const RescaledLaplacian> laplacian_;
};
TORCH_MODULE(ChebyshevConvolution);

/// The architecture of 6.5.3 with Chebyshev convolutions in place of the structure-aware ones. In place of the dense
/// block, it adds the mean over all nodes, multiplied by one shared matrix.
class ChebyshevNetworkImpl : public GraphNetwork {
 public:
  ChebyshevNetworkImpl(const MeshTopology& topology, int inputs, int outputs, const SagcnConfig& config, int order,
                       at::Generator generator);

  /// @param features [B,K,Hin] @return [B,K,Hout]
  torch::Tensor forward(const torch::Tensor& features) override;

 private:
  torch::Tensor unit(int index, const torch::Tensor& features);
  torch::Tensor dense(const torch::Tensor& features);

  SagcnConfig config_;
  int64_t num_nodes_;
  int inputs_;
  ChebyshevConvolution stem_{nullptr}, head_{nullptr};
  std::vector<FeatureNorm> norms_;
  std::vector<ChebyshevConvolution> convolutions_;
  FeatureNorm dense_norm_{nullptr};
  torch::Tensor dense_weight_, dense_bias_;
};
TORCH_MODULE(ChebyshevNetwork);

/// The settings of any of the three networks.
struct NetworkPlan {
  NetworkKind kind = NetworkKind::sagcn;
  SagcnConfig sagcn;
  AblationConfig ablation;
  int inputs = 0, outputs = 0;
};

/// @param topology the graph; its nodes are the rows of the output
/// @param generator draws the initial weights; by default a fresh one with a fixed seed
std::shared_ptr<GraphNetwork> make_network(const NetworkPlan& plan, const MeshTopology& topology,
                                           std::optional<at::Generator> generator);

/// The key `network`.
void describe_network_kind(const Keys& keys, NetworkKind& kind);
/// Refuses keys that the chosen network does not read, unless they have their default value.
/// @param defaults of the SAGCN keys
void refuse_unread_keys(const Keys& keys, NetworkKind kind, const SagcnConfig& sagcn, const SagcnConfig& defaults,
                        const AblationConfig& ablation);

/// The input of a network: (x - mean) / std, clamped to [-limit, limit] when limit > 0. The limit prevents the output
/// from exploding for poses far from the training set.
torch::Tensor standardised(const torch::Tensor& input, const torch::Tensor& mean, const torch::Tensor& std,
                           double limit);

/// The affine map (x - mean) / std in front of a network; identity until set. `mean` and `std` are buffers [rows,Hin]
/// of the network, so they are saved with the model.
/// @param found_mean, found_std [rows,Hin] or [Hin]; a std below `floor` is set to `floor`
/// @throws UsageError for another shape, Error for numbers that are not finite
void set_standardisation(torch::Tensor& mean, torch::Tensor& std, const torch::Tensor& found_mean,
                         const torch::Tensor& found_std, double floor, const char* network);

}  // namespace doppel
