#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>

namespace doppel {

/// Converts 8-bit BGR to float32 [H,W,3] RGB 0..1.
torch::Tensor tensor_of(const cv::Mat& image);
/// Converts [H,W,3] RGB, clamped to 0..1, to 8-bit BGR.
cv::Mat image_of(const torch::Tensor& colour);

}  // namespace doppel
