#include "doppel/nets/sagcn.h"

#include <ATen/CPUGeneratorImpl.h>
#include <torch/csrc/jit/frontend/tracer.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/reference_scope.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr uint64_t kSagcnSeed = 2021;

void draw_uniform(const Tensor& tensor, double bound, at::Generator& generator) {
  torch::NoGradGuard no_grad;
  tensor.uniform_(-bound, bound, generator);
}

/// The initialisation of the public code: a normal distribution with mean -1 and deviation 1, times a scale.
void draw_as_public_code(const Tensor& tensor, double scale, at::Generator& generator) {
  torch::NoGradGuard no_grad;
  tensor.normal_(-1.0, 1.0, generator).mul_(scale);
}

}  // namespace

void describe_keys(const Keys& keys, SagcnConfig& config) {
  keys("features", config.features, between(1, 1024), "per node inside the network");
  keys("residual_blocks", config.residual_blocks, between(0, 1000), "an even number");
  keys.require("residual_blocks", config.residual_blocks % 2 == 0,
               fmt::format("must be even (half before, half after the dense block), found {}", config.residual_blocks));
  keys("rings", config.rings, between(1, 16), "R of 6.6");
  keys("norm", config.norm, {"node", "channel", "none"}, "batch norm per node and feature, or per feature");
  keys("dense", config.dense, {"none", "broadcast", "matrix"}, "dense block; `broadcast` is that of 6.5.3");
  keys("dense_normalised", config.dense_normalised, "divide `broadcast` by the number of nodes");
  keys("head_scale", config.head_scale, between(0.0, 1.0),
       "size of the last layer's initial weights: training starts at outputs of about 0");
}

void SagcnConfig::check() const {
  std::string faults;
  const auto require = [&](bool met, const std::string& fault) {
    if (!met) faults += "\n  " + fault;
  };
  require(features >= 1, fmt::format("features must be at least 1, found {}", features));
  require(residual_blocks >= 0 && residual_blocks % 2 == 0,
          fmt::format("residual_blocks must be even and not negative, found {}", residual_blocks));
  require(rings >= 1, fmt::format("rings must be at least 1, found {}", rings));
  require(norm_momentum >= 0.0 && norm_momentum <= 1.0,
          fmt::format("norm_momentum must lie in [0, 1], found {}", norm_momentum));
  require(norm_epsilon > 0.0, fmt::format("norm_epsilon must be positive, found {}", norm_epsilon));
  require(head_scale >= 0.0, fmt::format("head_scale must not be negative, found {}", head_scale));
  if (!faults.empty()) fail<UsageError>("the configuration of the graph network cannot be used:{}", faults);
}

// ---- norm ----

FeatureNormImpl::FeatureNormImpl(int64_t num_nodes, int features, const SagcnConfig& config)
    : kind_(config.norm), momentum_(config.norm_momentum), epsilon_(config.norm_epsilon) {
  if (kind_ == SagcnNorm::none) return;
  const std::vector<int64_t> shape =
      kind_ == SagcnNorm::node ? std::vector<int64_t>{num_nodes, features} : std::vector<int64_t>{features};
  weight = register_parameter("weight", torch::ones(shape));
  bias = register_parameter("bias", torch::zeros(shape));
  running_mean = register_buffer("running_mean", torch::zeros(shape));
  running_var = register_buffer("running_var", torch::ones(shape));
}

NodeNorm FeatureNormImpl::node_norm(const Tensor& features, int64_t batch_dimension) const {
  if (kind_ != SagcnNorm::node) return {};
  if (!is_shared()) return {weight, bias, running_mean, running_var, is_training(), momentum_, epsilon_};
  const SharedStatistics shared = share_statistics(features, {batch_dimension}, weight, bias, running_mean, running_var,
                                                   momentum_, epsilon_, *ranks());
  return {shared.weight, shared.bias, shared.mean, shared.variance, false, momentum_, epsilon_};
}

NodeNorm FeatureNormImpl::running() const {
  return {weight, bias, running_mean, running_var, false, momentum_, epsilon_};
}

Tensor FeatureNormImpl::forward(const Tensor& features) {
  if (kind_ == SagcnNorm::none || features.numel() == 0) return features;
  if (kind_ == SagcnNorm::node) return node_norm_reference(features, node_norm(features, 0));
  const Tensor rows = features.flatten(0, 1);
  if (!is_shared())
    return at::batch_norm(rows, weight, bias, running_mean, running_var, is_training(), momentum_, epsilon_, false)
        .view_as(features);
  const SharedStatistics shared =
      share_statistics(rows, {0}, weight, bias, running_mean, running_var, momentum_, epsilon_, *ranks());
  return at::batch_norm(rows, shared.weight, shared.bias, shared.mean, shared.variance, false, 0.0, epsilon_, false)
      .view_as(features);
}

// ---- units ----

SagcnUnitImpl::SagcnUnitImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config) {
  norm = register_module("norm", FeatureNorm(ring.num_nodes, inputs, config));
  convolution = register_module("convolution", GraphConvolution(ring, inputs, outputs));
}

Tensor SagcnUnitImpl::forward_node_major(const Tensor& features, const Tensor& skip) {
  const bool apart = norm->kind() == SagcnNorm::channel;  // the fused convolution does not normalise channels
  const Tensor input = apart ? norm->forward(features.transpose(0, 1)).transpose(0, 1) : features;
  return elu_graph_convolution_node_major(input, norm->node_norm(input, 1), convolution->kernels, convolution->bias,
                                          convolution->ring(), skip);
}

Tensor SagcnUnitImpl::forward_reference(const Tensor& features) {
  return convolution->forward_reference(at::elu(norm->forward(features)));
}

DenseUnitImpl::DenseUnitImpl(int64_t num_nodes, const SagcnConfig& config)
    : kind_(config.dense), scale_(config.dense_normalised ? 1.0 / static_cast<double>(num_nodes) : 1.0) {
  norm = register_module("norm", FeatureNorm(num_nodes, config.features, config));
  kernels = register_parameter("kernels", kind_ == DenseBlock::matrix
                                              ? torch::zeros({num_nodes, num_nodes})
                                              : torch::zeros({num_nodes, config.features, config.features}));
  bias = register_parameter("bias", torch::zeros({num_nodes, config.features}));
}

Tensor DenseUnitImpl::forward(const Tensor& features) {
  const Tensor active = at::elu(norm->forward(features));
  return features + (kind_ == DenseBlock::matrix ? dense_matrix(active, kernels, bias)
                                                 : dense_broadcast(active, kernels, bias, scale_));
}

Tensor DenseUnitImpl::forward_node_major(const Tensor& features) {
  if (kind_ == DenseBlock::broadcast && norm->kind() == SagcnNorm::none)
    return elu_dense_broadcast_node_major(features, kernels, bias, scale_);
  return forward(features.transpose(0, 1)).transpose(0, 1);
}

// ---- network ----

SagcnImpl::SagcnImpl(const RingWeights& ring, int inputs, int outputs, const SagcnConfig& config,
                     std::optional<at::Generator> generator)
    : config_(config), num_nodes_(ring.num_nodes), inputs_(inputs) {
  config.check();
  stem_ = register_module("stem", GraphConvolution(ring, inputs, config.features));
  for (int i = 0; i < 2 * config.residual_blocks; ++i)
    units_.emplace_back(register_module(fmt::format("block{}_unit{}", i / 2, i % 2),
                                        SagcnUnit(ring, config.features, config.features, config)));
  if (config.dense != DenseBlock::none) dense_ = register_module("dense", DenseUnit(num_nodes_, config));
  head_ = register_module("head", GraphConvolution(ring, config.features, outputs));
  initialise(generator ? *generator : at::detail::createCPUGenerator(kSagcnSeed));
}

void SagcnImpl::initialise(at::Generator generator) {
  constexpr double kPublicScale = 1e-3, kPublicDenseScale = 1e-5;
  const bool as_public = config_.initialisation == SagcnInitialisation::public_code;
  const auto fill = [&](GraphConvolutionImpl& convolution, double bound) {
    if (as_public) {
      draw_as_public_code(convolution.kernels, kPublicScale, generator);
      draw_as_public_code(convolution.bias, kPublicScale, generator);
    } else {
      draw_uniform(convolution.kernels, bound, generator);
    }
  };
  const auto glorot = [](int64_t in, int64_t out) { return std::sqrt(6.0 / static_cast<double>(in + out)); };
  fill(*stem_, glorot(inputs_, config_.features));
  for (SagcnUnit& unit : units_) fill(*unit->convolution, glorot(config_.features, config_.features));
  fill(*head_, config_.head_scale);
  if (dense_.is_empty()) return;
  if (as_public)
    draw_as_public_code(dense_->kernels, kPublicDenseScale, generator);
  else
    draw_uniform(dense_->kernels, config_.head_scale, generator);
}

void SagcnImpl::check_input(const Tensor& features) const {
  check_shape("sagcn", "features", features, {-1, num_nodes_, inputs_}, "[B,K,Hin]");
  if (is_training() && config_.norm == SagcnNorm::node && features.size(0) == 1 && !shares_batch_statistics(*this))
    fail<UsageError>(
        "batch normalisation per node needs more than one sample while training: with a batch of 1 every normalised "
        "feature is 0; use a larger batch, `norm: channel` or `norm: none`");
}

bool SagcnImpl::dense_follows(int block) const { return !dense_.is_empty() && block == config_.residual_blocks / 2; }

Tensor SagcnImpl::forward(const Tensor& features) {
  check_input(features);
  if (!takes_kernel(features)) return forward_reference(features);
  if (runs_frozen(features)) {
    std::call_once(frozen_->once, [this] {
      frozen_->chain = std::make_unique<const GraphChain>(stem_->ring(), chain_layers(), frozen_->format);
    });
    return frozen_->chain->forward(features);
  }
  Tensor x = stem_->forward_node_major(features.transpose(0, 1));
  for (int block = 0; block <= config_.residual_blocks; ++block) {
    if (dense_follows(block)) x = dense_->forward_node_major(x);
    if (block == config_.residual_blocks) break;
    x = units_[2 * block + 1]->forward_node_major(units_[2 * block]->forward_node_major(x), x);
  }
  return elu_graph_convolution_node_major(x, {}, head_->kernels, head_->bias, head_->ring()).transpose(0, 1);
}

// ---- one sample ----

void SagcnImpl::freeze(WeightFormat format) {
  const bool fits = config_.features == GraphChain::kFeatures && head_->bias.size(1) <= GraphChain::kFeatures &&
                    (dense_.is_empty() || dense_->kind() == DenseBlock::broadcast);
  if (!fits) return;
  frozen_ = std::make_shared<Frozen>();
  frozen_->format = format;
}

bool SagcnImpl::runs_frozen(const Tensor& features) const {
  const bool gradient = torch::GradMode::is_enabled() && features.requires_grad();
  return frozen_ && !is_training() && !gradient && features.size(0) == 1 && !torch::jit::tracer::isTracing();
}

GraphChain::Layers SagcnImpl::chain_layers() const {
  GraphChain::Layers layers;
  layers.first = {stem_->kernels, stem_->bias, {}};
  for (const SagcnUnit& unit : units_)
    layers.units.push_back({unit->convolution->kernels, unit->convolution->bias, unit->norm->running()});
  layers.last = {head_->kernels, head_->bias, {}};
  if (dense_.is_empty()) return layers;
  layers.dense = GraphChain::Layer{dense_->kernels, dense_->bias, dense_->norm->running()};
  layers.dense_scale = dense_->scale();
  layers.dense_block = static_cast<std::size_t>(config_.residual_blocks / 2);
  return layers;
}

void freeze_graph_networks(torch::nn::Module& module, WeightFormat format) {
  module.apply([format](torch::nn::Module& part) {
    if (auto* network = dynamic_cast<SagcnImpl*>(&part)) network->freeze(format);
  });
}

Tensor SagcnImpl::forward_reference(const Tensor& features) {
  check_input(features);
  Tensor x = stem_->forward_reference(features);
  for (int block = 0; block <= config_.residual_blocks; ++block) {
    if (dense_follows(block)) x = dense_->forward(x);
    if (block == config_.residual_blocks) break;
    x = x + units_[2 * block + 1]->forward_reference(units_[2 * block]->forward_reference(x));
  }
  return head_->forward_reference(at::elu(x));
}

}  // namespace doppel
