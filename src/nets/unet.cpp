#include "doppel/nets/unet.h"

#include <ATen/CPUGeneratorImpl.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/image_convolution/image_convolution.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr uint64_t kUNetSeed = 2021;
constexpr int kMaxLevels = 10;
constexpr int kMaxChannels = 512;
constexpr int kDropoutLevels = 3;
constexpr double kInitialDeviation = 0.02;

ImageNorm make_norm(int64_t channels, const UNetConfig& config) {
  return ImageNorm(channels, config.norm_epsilon, config.norm_momentum);
}

}  // namespace

void describe_keys(const Keys& keys, UNetConfig& config) {
  keys("first_channels", config.first_channels, between(1, 512),
       "after the first halving; each further one doubles them, up to 512");
  keys("width", config.width, between(0.01, 4.0), "factor of all channels");
  keys("leaky_slope", config.leaky_slope, between(0.0, 1.0), "of the encoder's activation below 0");
  keys("upsample", config.upsample, {"transposed", "bilinear_conv"}, "layers of the decoder");
  keys("dropout", config.dropout, between(0.0, 0.95), "on the three innermost decoder levels while training");
  keys("head_scale", config.head_scale, between(0.0, 10.0), "factor of the last layer's initial weights");
}

void UNetConfig::check() const {
  std::string faults;
  const auto require = [&](bool met, const std::string& fault) {
    if (!met) faults += "\n  " + fault;
  };
  require(levels >= 1 && levels <= kMaxLevels,
          fmt::format("levels must lie between 1 and {}, found {}", kMaxLevels, levels));
  require(first_channels >= 1 && first_channels <= kMaxChannels,
          fmt::format("first_channels must lie between 1 and {}, found {}", kMaxChannels, first_channels));
  require(width > 0.0, fmt::format("width must be positive, found {}", width));
  require(dropout >= 0.0 && dropout < 1.0, fmt::format("dropout must lie in [0, 1), found {}", dropout));
  require(norm_epsilon > 0.0, fmt::format("norm_epsilon must be positive, found {}", norm_epsilon));
  require(norm_momentum >= 0.0 && norm_momentum <= 1.0,
          fmt::format("norm_momentum must lie in [0, 1], found {}", norm_momentum));
  require(head_scale >= 0.0, fmt::format("head_scale must not be negative, found {}", head_scale));
  if (!faults.empty()) fail<UsageError>("the configuration of the UNet cannot be used:{}", faults);
}

int64_t UNetConfig::channels(int level) const {
  const double full = std::min(kMaxChannels, first_channels << std::min(level, kMaxLevels - 1));
  return std::max<int64_t>(1, std::llround(full * width));
}

bool runs_kernels(const torch::nn::Module& network, const Tensor& input) {
  return !network.is_training() && !torch::GradMode::is_enabled() && takes_kernel(input);
}

Tensor UNetImage::joined() const { return second.defined() ? at::cat({first, second}, 1) : first; }

Tensor dropout(const Tensor& features, double probability, const at::Generator& generator, const BatchShare& share) {
  if (probability <= 0.0) return features;
  const Tensor kept =
      at::empty(share.whole_sizes(features.sizes()), features.options()).bernoulli_(1.0 - probability, generator);
  return features * share.rows(kept).div_(1.0 - probability);
}

namespace {

/// The 3x3 kernels of transposed_convolution. @param weight [Cin,Cout,4,4] @return [4 Cout,Cin,3,3]
Tensor transposed_kernels(const Tensor& weight) {
  // Along one axis, output 2m takes taps 3 and 1 at inputs m-1 and m; output 2m+1 takes 2 and 0 at m and m+1. Tap 4 is
  // 0.
  const Tensor taps = torch::tensor({3, 1, 4, 4, 2, 0}, torch::kInt64);
  const Tensor chosen = at::constant_pad_nd(weight, {0, 1, 0, 1}).index_select(2, taps).index_select(3, taps);
  const int64_t in = weight.size(0), out = weight.size(1);
  return chosen.view({in, out, 2, 3, 2, 3}).permute({1, 2, 4, 0, 3, 5}).reshape({4 * out, in, 3, 3});
}

}  // namespace

Tensor transposed_convolution(const Tensor& features, const Tensor& weight, const Tensor& bias) {
  const Tensor doubled = at::pixel_shuffle(at::conv2d(features, transposed_kernels(weight), {}, 1, 1), 2);
  return bias.defined() ? doubled + bias.view({1, -1, 1, 1}) : doubled;
}

UNetImpl::UNetImpl(int64_t inputs, int64_t outputs, const UNetConfig& config, std::optional<at::Generator> generator)
    : config_(config), inputs_(inputs) {
  config.check();
  const auto name = [](const char* what, int level) { return what + std::to_string(level); };
  for (int level = 0; level < config.levels; ++level) {
    const int64_t in = level == 0 ? inputs : config.channels(level - 1), out = config.channels(level);
    down_.emplace_back(register_module(
        name("down", level), torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, 4).stride(2).padding(1).bias(false))));
    if (level > 0) down_norm_.emplace_back(register_module(name("down_norm", level), make_norm(out, config)));
  }
  // up level i brings the resolution of level i back to that of level i - 1, so the last one is number 0.
  for (int level = config.levels - 1; level >= 0; --level) {
    const int64_t in = config.channels(level) * (level == config.levels - 1 ? 1 : 2);
    const int64_t out = level == 0 ? outputs : config.channels(level - 1);
    if (config.upsample == Upsampling::transposed)
      up_transposed_.emplace_back(register_module(
          name("up", level), torch::nn::ConvTranspose2d(
                                 torch::nn::ConvTranspose2dOptions(in, out, 4).stride(2).padding(1).bias(level == 0))));
    else
      up_convolution_.emplace_back(register_module(
          name("up", level), torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, 3).padding(1).bias(level == 0))));
    if (level > 0) up_norm_.emplace_back(register_module(name("up_norm", level), make_norm(out, config)));
  }
  initialise(generator ? *generator : at::detail::createCPUGenerator(kUNetSeed));
}

void UNetImpl::initialise(const at::Generator& generator) {
  torch::NoGradGuard no_grad;
  for (auto& item : named_parameters()) {
    if (item.value().dim() == 4)
      item.value().normal_(0.0, kInitialDeviation, generator);
    else if (item.key() == "up0.bias")
      item.value().zero_();
  }
  named_parameters()["up0.weight"].mul_(config_.head_scale);
}

Tensor UNetImpl::down(int level, const Tensor& features) {
  const Tensor x = down_[level]->forward(features);
  return at::leaky_relu(level == 0 ? x : down_norm_[level - 1]->forward(x), config_.leaky_slope);
}

Tensor UNetImpl::up(int level, const Tensor& features, const std::optional<at::Generator>& generator,
                    const BatchShare& share) {
  const int step = config_.levels - 1 - level;
  Tensor x;
  if (config_.upsample == Upsampling::transposed) {
    x = transposed_convolution(features, up_transposed_[step]->weight, up_transposed_[step]->bias);
  } else {
    x = up_convolution_[step]->forward(
        at::upsample_bilinear2d(features, c10::nullopt, false, std::vector<double>{2.0, 2.0}));
  }
  if (level == 0) return x;
  x = up_norm_[step]->forward(x);
  if (step < kDropoutLevels && is_training() && config_.dropout > 0.0)
    x = dropout(x, config_.dropout, *generator, share);
  return at::relu(x);
}

Tensor UNetImpl::infer_up(int level, const UNetImage& features) {
  const int step = config_.levels - 1 - level;
  const bool transposed = config_.upsample == Upsampling::transposed;
  ImageConvolution layer;
  layer.weight = transposed ? transposed_kernels(up_transposed_[step]->weight) : up_convolution_[step]->weight;
  layer.enlarge = !transposed;
  if (level > 0) {
    const ImageNormImpl::Affine norm = up_norm_[step]->in_evaluation();
    layer.scale = norm.scale;
    layer.shift = norm.shift;
    layer.slope = 0.0;
  } else {
    layer.shift = transposed ? up_transposed_[step]->bias : up_convolution_[step]->bias;
  }
  if (!transposed) return image_convolution(features.first, features.second, layer);
  // Four output channels of the kernels become the four pixels of one.
  const auto four_times = [](const Tensor& channels) { return channels.unsqueeze(1).expand({-1, 4}).reshape({-1}); };
  if (layer.scale.defined()) layer.scale = four_times(layer.scale);
  layer.shift = four_times(layer.shift);
  return at::pixel_shuffle(image_convolution(features.first, features.second, layer), 2);
}

Tensor UNetImpl::infer(const UNetImage& image) {
  std::vector<Tensor> skips;
  for (int level = 0; level < config_.levels; ++level) {
    ImageConvolution layer;
    layer.weight = down_[level]->weight;
    layer.slope = config_.leaky_slope;
    if (level > 0) {
      const ImageNormImpl::Affine norm = down_norm_[level - 1]->in_evaluation();
      layer.scale = norm.scale;
      layer.shift = norm.shift;
    }
    skips.push_back(level == 0 ? image_convolution(image.first, image.second, layer)
                               : image_convolution(skips.back(), {}, layer));
  }
  Tensor x = infer_up(config_.levels - 1, skips.back());
  for (int level = config_.levels - 2; level >= 0; --level) x = infer_up(level, {x, skips[level]});
  return x;
}

void UNetImpl::check_input(const UNetImage& parts, bool has_generator) const {
  const Tensor& image = parts.first;
  const int64_t others = parts.second.defined() ? parts.second.size(1) : 0;
  check_shape("unet", "image", image, {-1, inputs_ - others, -1, -1}, "[B,Cin,H,W]");
  const int64_t step = int64_t{1} << config_.levels, H = image.size(2), W = image.size(3);
  if (H % step != 0 || W % step != 0 || H == 0 || W == 0)
    fail<UsageError>("a UNet of {} levels takes images whose sides are multiples of {}, found {} x {}", config_.levels,
                     step, H, W);
  if (!is_training()) return;
  if (config_.levels > 1 && image.size(0) * (H / step) * (W / step) == 1 && !shares_batch_statistics(*this))
    fail<UsageError>(
        "batch normalisation of a single value gives 0: a training batch of 1 whose innermost map is one pixel ({} "
        "levels, {} x {}) cannot be used; use a larger batch or fewer levels",
        config_.levels, H, W);
  if (config_.dropout > 0.0 && config_.levels > 1 && !has_generator)
    fail<UsageError>("a UNet in training needs the generator of its dropout; pass one, or set dropout: 0");
}

Tensor UNetImpl::forward(const UNetImage& image, const std::optional<at::Generator>& generator,
                         const BatchShare& share) {
  check_input(image, generator.has_value());
  if (image.first.size(0) == 0) {
    const int64_t outputs = named_parameters()["up0.bias"].size(0);
    return image.first.new_zeros({0, outputs, image.first.size(2), image.first.size(3)});
  }
  if (runs_kernels(*this, image.first)) return infer(image);
  std::vector<Tensor> skips;
  Tensor x = image.joined();
  for (int level = 0; level < config_.levels; ++level) skips.push_back(x = down(level, x));
  for (int level = config_.levels - 1; level >= 0; --level)
    x = up(level, level == config_.levels - 1 ? x : at::cat({x, skips[level]}, 1), generator, share);
  return x;
}

}  // namespace doppel
