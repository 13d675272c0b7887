#pragma once

/// LPIPS (Zhang et al. 2018), version 0.1 with the features of AlexNet: a distance between images in the features of a
/// network that was trained to recognise objects, weighted so that it agrees with human judgement.

#include <torch/types.h>

#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/nets/weights/weights_file.h"

namespace doppel {

/// d(a,b) = sum_l mean_hw sum_c w_lc (a_lchw - b_lchw)^2. a_l and b_l are the features after the l-th of AlexNet's five
/// rectified convolutions, divided in each pixel by their norm over the channels c; w_l >= 0 are learnt.
class Lpips {
 public:
  /// Needs the convolutions of AlexNet under the names of torchvision (`features.0.weight`, `features.0.bias`, ...) or
  /// of the package lpips (`net.slice1.0.weight`, ...), and w_l as `lin0.model.1.weight`, ... Other tensors are
  /// ignored. Of tensors with one name, the first counts.
  /// @param source of the weights, for messages
  /// @throws FileError naming tensors that are missing or of another shape, or a w_l below 0
  Lpips(const NamedWeights& weights, const std::string& source);
  /// Reads the weights from one file or several (weights_file.h).
  /// @throws UsageError without a file; FileError as read_weights and as above
  static Lpips load(const std::vector<std::filesystem::path>& files);

  /// @param a, b [B,3,H,W] RGB -1..1, sides of at least 31 pixels @return float32 [B], without gradient
  /// @throws UsageError for other shapes
  torch::Tensor distance(const torch::Tensor& a, const torch::Tensor& b) const;
  /// The distance of two 8-bit RGB images of one size, 0..255. @throws UsageError for other images
  double distance(const cv::Mat& a, const cv::Mat& b) const;

  const std::string& source() const { return source_; }

 private:
  static constexpr std::size_t kLayers = 5;
  /// The features of the layers, each [B,C,h,w]. @param image [B,3,H,W] RGB -1..1
  std::array<torch::Tensor, kLayers> features(const torch::Tensor& image) const;

  std::string source_;
  std::array<torch::Tensor, kLayers> weight_, bias_;  ///< of the convolutions
  std::array<torch::Tensor, kLayers> importance_;     ///< w_l [1,C,1,1]
};

}  // namespace doppel
