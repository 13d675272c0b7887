#pragma once

/// ResNet (He et al. 2016) with the layers, parameter names and shapes of torchvision, so that torchvision's published
/// weights can be loaded. The classifier `fc` is left out: the network ends with the mean over the image.

#include <torch/nn/module.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/nets/shared_norm.h"

namespace doppel {

/// Two 3x3 convolutions (18 layers), or 1x1, 3x3, 1x1 with four times the channels (50 layers), beside a shortcut.
class ResidualUnitImpl : public torch::nn::Module {
 public:
  /// @param inputs channels @param width of the 3x3 convolutions @param outputs channels; if `outputs` differs from
  /// `inputs`, or with a stride, the shortcut is a 1x1 convolution
  ResidualUnitImpl(int64_t inputs, int64_t width, int64_t outputs, int64_t stride, bool bottleneck);
  torch::Tensor forward(const torch::Tensor& features);

 private:
  std::vector<torch::nn::Conv2d> convolutions_;  ///< conv1, conv2[, conv3]
  std::vector<ImageNorm> norms_;                 ///< bn1, bn2[, bn3]
  torch::nn::Sequential shortcut_{nullptr};      ///< torchvision's `downsample`, or none
};
TORCH_MODULE(ResidualUnit);

enum class ResNetKind { resnet18, resnet50 };

class ResNetImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial convolutions (He et al. 2015, fan out)
  ResNetImpl(ResNetKind kind, const at::Generator& generator);

  /// @param image [B,3,H,W], sides of at least 32, colours standardised by ImageNet's mean and deviation
  /// @return [B,features()]
  /// @throws UsageError for another shape
  torch::Tensor forward(const torch::Tensor& image);

  int64_t features() const { return features_; }  ///< 512 or 2048

 private:
  int64_t features_;
  torch::nn::Conv2d first_{nullptr};
  ImageNorm first_norm_{nullptr};
  std::vector<torch::nn::Sequential> layers_;
};
TORCH_MODULE(ResNet);

/// The configuration of PoseNet and DefNet.
struct BackboneConfig {
  ResNetKind kind = ResNetKind::resnet50;
  int input_size = 256;              ///< S: side of the images
  std::filesystem::path pretrained;  ///< weights to start from (weights_file.h); empty: random ones
  /// Batch normalisation keeps the statistics of `pretrained`, for batches that are too small for statistics of their
  /// own.
  bool freeze_norm = false;
  /// Standard deviation of the last layer's initial weights: small, so that training starts from the layer's bias.
  double head_scale = 1e-3;
};
void describe_keys(const Keys& keys, BackboneConfig& config);

/// A ResNet followed by one fully connected layer.
class BackboneImpl : public torch::nn::Module {
 public:
  /// @param outputs numbers per image @param head_bias [outputs] initial output
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  BackboneImpl(const BackboneConfig& config, int64_t outputs, const torch::Tensor& head_bias,
               std::optional<at::Generator> generator);

  /// @param image [B,3,S,S] @return [B,outputs]
  torch::Tensor forward(const torch::Tensor& image);
  void train(bool on = true) override;

  /// Loads the weights of `config.pretrained`, if it is set. The last layer is not changed.
  /// @throws FileError when the weights are of another architecture
  void load_pretrained();

  const BackboneConfig& config() const { return config_; }

 private:
  BackboneConfig config_;
  ResNet resnet_{nullptr};
  torch::nn::Linear head_{nullptr};
};
TORCH_MODULE(Backbone);

}  // namespace doppel
