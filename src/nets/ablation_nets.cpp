#include "doppel/nets/ablation_nets.h"

#include <ATen/CPUGeneratorImpl.h>
#include <torch/csrc/jit/frontend/tracer.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr uint64_t kAblationSeed = 2021;

void draw_uniform(const Tensor& tensor, double bound, at::Generator& generator) {
  torch::NoGradGuard no_grad;
  tensor.uniform_(-bound, bound, generator);
}

double glorot(int64_t in, int64_t out) { return std::sqrt(6.0 / static_cast<double>(in + out)); }

/// sum_p weights[k,p] features[neighbours[k,p]] for [K,M].
Tensor gather_sum(const Tensor& features, const Tensor& neighbours, const Tensor& weights) {
  const int64_t K = neighbours.size(0), P = neighbours.size(1);
  const Tensor gathered = features.index_select(0, neighbours.flatten()).view({K, P, -1});
  return at::bmm(weights.unsqueeze(1), gathered).squeeze(1);
}

/// The matrix is symmetric, so the backward pass is the same product. The backward pass of autograd would scatter,
/// which is slower.
struct SymmetricProduct : torch::autograd::Function<SymmetricProduct> {
  static Tensor forward(torch::autograd::AutogradContext* context, const Tensor& features, const Tensor& neighbours,
                        const Tensor& weights) {
    context->save_for_backward({neighbours, weights});
    return gather_sum(features, neighbours, weights);
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grad) {
    const auto saved = context->get_saved_variables();
    return {apply(grad[0].contiguous(), saved[0], saved[1]), Tensor(), Tensor()};
  }
};

}  // namespace

// ---- configuration ----

void describe_keys(const Keys& keys, AblationConfig& config) {
  keys("chebyshev_order", config.chebyshev_order, between(1, 32), "polynomials of `network: chebyshev`");
}

void AblationConfig::check() const {
  std::string faults;
  const auto require = [&](bool met, const std::string& fault) {
    if (!met) faults += "\n  " + fault;
  };
  require(fully_connected_layers >= 1,
          fmt::format("fully_connected_layers must be at least 1, found {}", fully_connected_layers));
  require(fully_connected_width >= 1,
          fmt::format("fully_connected_width must be at least 1, found {}", fully_connected_width));
  require(chebyshev_order >= 1, fmt::format("chebyshev_order must be at least 1, found {}", chebyshev_order));
  if (!faults.empty()) fail<UsageError>("the configuration of a baseline network cannot be used:{}", faults);
}

// ---- fully connected ----

FullyConnectedImpl::FullyConnectedImpl(int64_t inputs, int64_t nodes, int64_t outputs, const AblationConfig& config,
                                       double head_scale, at::Generator generator)
    : inputs_(inputs), nodes_(nodes), outputs_(outputs) {
  config.check();
  const int count = config.fully_connected_layers;
  for (int i = 0; i < count; ++i) {
    const int64_t in = i == 0 ? inputs : config.fully_connected_width;
    const int64_t out = i + 1 == count ? nodes * outputs : config.fully_connected_width;
    layers_.emplace_back(register_module("layer" + std::to_string(i), torch::nn::Linear(in, out)));
    draw_uniform(layers_.back()->weight, i + 1 == count ? head_scale : glorot(in, out), generator);
    torch::NoGradGuard no_grad;
    layers_.back()->bias.zero_();
  }
}

Tensor FullyConnectedImpl::forward(const Tensor& features) {
  check_shape("fully connected network", "features", features, {-1, 1, inputs_}, "[B,1,Hin]");
  Tensor x = features.squeeze(1);
  for (std::size_t i = 0; i < layers_.size(); ++i) x = layers_[i]->forward(i == 0 ? x : at::elu(x));
  return x.view({-1, nodes_, outputs_});
}

// ---- Chebyshev graph convolution ----

RescaledLaplacian::RescaledLaplacian(const MeshTopology& topology) : num_nodes(topology.num_vertices()) {
  const auto& ring = topology.one_ring();
  const auto degree = [&](int k) { return static_cast<int64_t>(ring.size(k)); };
  int64_t longest = 1;
  for (int k = 0; k < num_nodes; ++k) longest = std::max(longest, degree(k));
  neighbours = torch::zeros({num_nodes, longest}, torch::kInt64);
  weights = torch::zeros({num_nodes, longest}, torch::kFloat64);
  auto to = neighbours.accessor<int64_t, 2>();
  auto weight = weights.accessor<double, 2>();
  for (int k = 0; k < num_nodes; ++k)
    for (int64_t e = 0; e < degree(k); ++e) {
      const int l = ring.row(k)[e];
      to[k][e] = l;
      weight[k][e] = -1.0 / std::sqrt(static_cast<double>(degree(k) * degree(l)));
    }
}

Tensor RescaledLaplacian::multiply(const Tensor& features) const {
  const Tensor weight = constant_like(weights, features), index = index_like(neighbours, features);
  if (torch::jit::tracer::isTracing()) return gather_sum(features, index, weight);
  return SymmetricProduct::apply(features, index, weight);
}

ChebyshevConvolutionImpl::ChebyshevConvolutionImpl(std::shared_ptr<const RescaledLaplacian> laplacian, int64_t inputs,
                                                   int64_t outputs, int order)
    : laplacian_(std::move(laplacian)) {
  weight = register_parameter("weight", torch::zeros({order, inputs, outputs}));
  bias = register_parameter("bias", torch::zeros({outputs}));
}

Tensor ChebyshevConvolutionImpl::forward(const Tensor& features) {
  const int64_t K = laplacian_->num_nodes, order = weight.size(0), H = weight.size(1);
  // Node-major rows [K, B Hin], so that the whole batch of a neighbour is contiguous.
  Tensor before, current = features.transpose(0, 1).reshape({K, -1});
  Tensor sum;
  for (int64_t m = 0; m < order; ++m) {
    if (m == 1) {
      before = current;
      current = laplacian_->multiply(current);
    } else if (m > 1) {
      const Tensor next = 2.0 * laplacian_->multiply(current) - before;
      before = current;
      current = next;
    }
    const Tensor term = at::matmul(current.view({K, -1, H}), weight[m]);
    sum = m == 0 ? term : sum + term;
  }
  return (sum + bias).transpose(0, 1);
}

ChebyshevNetworkImpl::ChebyshevNetworkImpl(const MeshTopology& topology, int inputs, int outputs,
                                           const SagcnConfig& config, int order, at::Generator generator)
    : config_(config), num_nodes_(topology.num_vertices()), inputs_(inputs) {
  config.check();
  const auto laplacian = std::make_shared<const RescaledLaplacian>(topology);
  const int H = config.features;
  const auto make = [&](const std::string& name, int in, int out, double bound) {
    auto convolution = register_module(name, ChebyshevConvolution(laplacian, in, out, order));
    draw_uniform(convolution->weight, bound, generator);
    return convolution;
  };
  stem_ = make("stem", inputs, H, glorot(inputs, H));
  for (int i = 0; i < 2 * config.residual_blocks; ++i) {
    const std::string unit_name = fmt::format("block{}_unit{}", i / 2, i % 2);
    norms_.emplace_back(register_module(unit_name + "_norm", FeatureNorm(num_nodes_, H, config)));
    convolutions_.emplace_back(make(unit_name, H, H, glorot(H, H)));
  }
  if (config.dense != DenseBlock::none) {
    dense_norm_ = register_module("dense_norm", FeatureNorm(num_nodes_, H, config));
    dense_weight_ = register_parameter("dense_weight", torch::zeros({H, H}));
    dense_bias_ = register_parameter("dense_bias", torch::zeros({H}));
    draw_uniform(dense_weight_, config.head_scale, generator);
  }
  head_ = make("head", H, outputs, config.head_scale);
}

Tensor ChebyshevNetworkImpl::unit(int index, const Tensor& features) {
  return convolutions_[index]->forward(at::elu(norms_[index]->forward(features)));
}

Tensor ChebyshevNetworkImpl::dense(const Tensor& features) {
  const Tensor mean = at::elu(dense_norm_->forward(features)).mean(1, true);
  return features + at::matmul(mean, dense_weight_) + dense_bias_;
}

Tensor ChebyshevNetworkImpl::forward(const Tensor& features) {
  check_shape("chebyshev network", "features", features, {-1, num_nodes_, inputs_}, "[B,K,Hin]");
  if (is_training() && config_.norm == SagcnNorm::node && features.size(0) == 1 && !shares_batch_statistics(*this))
    fail<UsageError>(
        "batch normalisation per node needs more than one sample while training: with a batch of 1 every normalised "
        "feature is 0; use a larger batch, `norm: channel` or `norm: none`");
  if (features.size(0) == 0) return features.new_zeros({0, num_nodes_, head_->bias.size(0)});
  Tensor x = stem_->forward(features);
  for (int block = 0; block <= config_.residual_blocks; ++block) {
    if (!dense_norm_.is_empty() && block == config_.residual_blocks / 2) x = dense(x);
    if (block == config_.residual_blocks) break;
    x = x + unit(2 * block + 1, unit(2 * block, x));
  }
  return head_->forward(at::elu(x));
}

// ---- the choice ----

std::shared_ptr<GraphNetwork> make_network(const NetworkPlan& plan, const MeshTopology& topology,
                                           std::optional<at::Generator> generator) {
  const auto own_or_default = [&] { return generator ? *generator : at::detail::createCPUGenerator(kAblationSeed); };
  switch (plan.kind) {
    case NetworkKind::fully_connected:
      return std::make_shared<FullyConnectedImpl>(plan.inputs, topology.num_vertices(), plan.outputs, plan.ablation,
                                                  plan.sagcn.head_scale, own_or_default());
    case NetworkKind::chebyshev:
      return std::make_shared<ChebyshevNetworkImpl>(topology, plan.inputs, plan.outputs, plan.sagcn,
                                                    plan.ablation.chebyshev_order, own_or_default());
    default:
      return std::make_shared<SagcnImpl>(RingWeights::from_topology(topology, plan.sagcn.rings), plan.inputs,
                                         plan.outputs, plan.sagcn, generator);
  }
}

void describe_network_kind(const Keys& keys, NetworkKind& kind) {
  keys("network", kind, network_kind_words(), "graph network, or a baseline of Table 6.4");
}

void refuse_unread_keys(const Keys& keys, NetworkKind kind, const SagcnConfig& sagcn, const SagcnConfig& defaults,
                        const AblationConfig& ablation) {
  const bool flat = kind == NetworkKind::fully_connected, structured = kind == NetworkKind::sagcn;
  const std::string unread = fmt::format(
      "`network: {}` does not read this key, so its value has no effect; leave the key out, or choose another network",
      network_kind_words()[as_size(kind)]);
  keys.require("features", !flat || sagcn.features == defaults.features, unread);
  keys.require("residual_blocks", !flat || sagcn.residual_blocks == defaults.residual_blocks, unread);
  keys.require("norm", !flat || sagcn.norm == defaults.norm, unread);
  keys.require("dense", !flat || sagcn.dense == defaults.dense, unread);
  keys.require("rings", structured || sagcn.rings == defaults.rings, unread);
  keys.require("dense_normalised", structured || sagcn.dense_normalised == defaults.dense_normalised, unread);
  keys.require("dense_normalised",
               sagcn.dense == DenseBlock::broadcast || sagcn.dense_normalised == defaults.dense_normalised,
               "only `dense: broadcast` reads this key; leave it out, or set dense: broadcast");
  keys.require("dense", kind != NetworkKind::chebyshev || sagcn.dense != DenseBlock::matrix,
               "`network: chebyshev` has no learned matrix in its dense block; set dense: broadcast or none");
  keys.require(
      "head_scale",
      !structured || sagcn.initialisation == SagcnInitialisation::glorot || sagcn.head_scale == defaults.head_scale,
      "`preset: public_checkpoint` draws the weights of the last layer as the public code does and does not "
      "read this key; leave it out, or set preset: paper");
  keys.require("chebyshev_order",
               kind == NetworkKind::chebyshev || ablation.chebyshev_order == AblationConfig().chebyshev_order,
               "only `network: chebyshev` reads this key; leave it out, or set network: chebyshev");
}

Tensor standardised(const Tensor& input, const Tensor& mean, const Tensor& std, double limit) {
  const Tensor scaled = (input - mean) / std;
  return limit > 0.0 ? scaled.clamp(-limit, limit) : scaled;
}

void set_standardisation(Tensor& mean, Tensor& std, const Tensor& found_mean, const Tensor& found_std, double floor,
                         const char* network) {
  torch::NoGradGuard no_grad;
  const int64_t rows = mean.size(0), inputs = mean.size(1);
  for (const Tensor& statistic : {found_mean, found_std})
    if (!statistic.defined() || statistic.dim() < 1 || statistic.dim() > 2 || statistic.size(-1) != inputs ||
        (statistic.dim() == 2 && statistic.size(0) != rows))
      fail<UsageError>("input statistics of {} must be [{},{}] or [{}], found {}", network, rows, inputs, inputs,
                       describe(statistic));
  if (!torch::isfinite(found_mean).all().item<bool>() || !torch::isfinite(found_std).all().item<bool>())
    fail("the input statistics of {} are not finite; a motion of the training set holds bad numbers", network);
  mean.copy_(found_mean.expand_as(mean));
  std.copy_(found_std.clamp_min(floor).expand_as(std));
}

}  // namespace doppel
