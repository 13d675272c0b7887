#include "doppel/nets/resnet.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/nets/weights/weights_file.h"

namespace doppel {

using torch::Tensor;

namespace {

torch::nn::Conv2d convolution(int64_t inputs, int64_t outputs, int64_t side, int64_t stride) {
  return torch::nn::Conv2d(
      torch::nn::Conv2dOptions(inputs, outputs, side).stride(stride).padding(side / 2).bias(false));
}

/// Units per layer, and whether they are bottlenecks.
struct Plan {
  std::vector<int> units;
  bool bottleneck;
};
Plan plan_of(ResNetKind kind) {
  if (kind == ResNetKind::resnet18) return {{2, 2, 2, 2}, false};
  return {{3, 4, 6, 3}, true};
}

}  // namespace

ResidualUnitImpl::ResidualUnitImpl(int64_t inputs, int64_t width, int64_t outputs, int64_t stride, bool bottleneck) {
  if (bottleneck)
    convolutions_ = {convolution(inputs, width, 1, 1), convolution(width, width, 3, stride),
                     convolution(width, outputs, 1, 1)};
  else
    convolutions_ = {convolution(inputs, width, 3, stride), convolution(width, outputs, 3, 1)};
  for (std::size_t i = 0; i < convolutions_.size(); ++i) {
    const std::string number = std::to_string(i + 1);
    norms_.emplace_back(convolutions_[i]->options.out_channels());
    register_module("conv" + number, convolutions_[i]);
    register_module("bn" + number, norms_[i]);
  }
  if (stride == 1 && inputs == outputs) return;
  shortcut_ = torch::nn::Sequential(convolution(inputs, outputs, 1, stride), ImageNorm(outputs));
  register_module("downsample", shortcut_);
}

Tensor ResidualUnitImpl::forward(const Tensor& features) {
  Tensor x = features;
  for (std::size_t i = 0; i < convolutions_.size(); ++i) {
    x = norms_[i]->forward(convolutions_[i]->forward(x));
    if (i + 1 < convolutions_.size()) x = x.relu_();
  }
  return (x + (shortcut_ ? shortcut_->forward(features) : features)).relu_();
}

ResNetImpl::ResNetImpl(ResNetKind kind, const at::Generator& generator) {
  const Plan plan = plan_of(kind);
  first_ = register_module("conv1", convolution(3, 64, 7, 2));
  first_norm_ = register_module("bn1", ImageNorm(64));
  int64_t channels = 64;
  for (std::size_t layer = 0; layer < plan.units.size(); ++layer) {
    const int64_t width = int64_t{64} << layer, outputs = plan.bottleneck ? 4 * width : width;
    torch::nn::Sequential units;
    for (int unit = 0; unit < plan.units[layer]; ++unit) {
      const int64_t stride = layer > 0 && unit == 0 ? 2 : 1;
      units->push_back(ResidualUnit(channels, width, outputs, stride, plan.bottleneck));
      channels = outputs;
    }
    layers_.emplace_back(register_module("layer" + std::to_string(layer + 1), units));
  }
  features_ = channels;
  const torch::NoGradGuard no_grad;
  for (auto& item : named_parameters()) {
    Tensor& weight = item.value();
    if (weight.dim() != 4) continue;
    const double fan_out = static_cast<double>(weight.size(0) * weight.size(2) * weight.size(3));
    weight.normal_(0.0, std::sqrt(2.0 / fan_out), generator);
  }
}

Tensor ResNetImpl::forward(const Tensor& image) {
  check_shape("resnet", "image", image, {-1, 3, -1, -1}, "[B,3,H,W]");
  if (image.size(2) < 32 || image.size(3) < 32)
    fail<UsageError>("resnet: images must have sides of at least 32 pixels, found {}", describe(image));
  Tensor x = first_norm_->forward(first_->forward(image)).relu_();
  x = torch::max_pool2d(x, {3, 3}, {2, 2}, {1, 1});
  for (torch::nn::Sequential& layer : layers_) x = layer->forward(x);
  return x.mean({2, 3});
}

void describe_keys(const Keys& keys, BackboneConfig& config) {
  keys("backbone", config.kind, {"resnet18", "resnet50"}, "network of the image");
  keys("input_size", config.input_size, between(32, 1024), "side of the images");
  keys("pretrained", config.pretrained, "weights to start from; none: random ones");
  keys("freeze_norm", config.freeze_norm, "batch normalisation keeps the statistics of `pretrained`");
  keys("head_scale", config.head_scale, at_least(0.0), "standard deviation of the last layer's initial weights");
}

BackboneImpl::BackboneImpl(const BackboneConfig& config, int64_t outputs, const Tensor& head_bias,
                           std::optional<at::Generator> generator)
    : config_(config) {
  at::Generator draw = generator ? *generator : at::detail::createCPUGenerator(1);
  resnet_ = register_module("resnet", ResNet(config.kind, draw));
  head_ = register_module("head", torch::nn::Linear(resnet_->features(), outputs));
  const torch::NoGradGuard no_grad;
  head_->weight.normal_(0.0, config.head_scale, draw);
  head_->bias.copy_(head_bias);
}

Tensor BackboneImpl::forward(const Tensor& image) {
  const int64_t S = config_.input_size;
  check_shape("backbone", "image", image, {-1, 3, S, S}, "[B,3,S,S]");
  return head_->forward(resnet_->forward(image));
}

void BackboneImpl::train(bool on) {
  torch::nn::Module::train(on);
  if (config_.freeze_norm) resnet_->eval();
}

void BackboneImpl::load_pretrained() {
  if (config_.pretrained.empty()) return;
  load_weights(*resnet_, read_weights(config_.pretrained), config_.pretrained, {"fc."});
}

}  // namespace doppel
