#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>

namespace doppel {

/// 8-bit BGR as float32 [H,W,3] RGB 0..1.
torch::Tensor tensor_of(const cv::Mat& image);
/// [H,W,3] RGB, held to 0..1, as 8-bit BGR.
cv::Mat image_of(const torch::Tensor& colour);

}  // namespace doppel
