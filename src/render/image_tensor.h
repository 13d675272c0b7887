#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>

namespace doppel {

/// Converts 8-bit BGR to float32 [H,W,3] RGB 0..1.
torch::Tensor tensor_of(const cv::Mat& image);
/// Converts [H,W,3] RGB, clamped to 0..1, to 8-bit BGR.
cv::Mat image_of(const torch::Tensor& colour);
/// A drawing over a picture: colour + (1 - alpha) * behind, clamped to 0..1, as 8-bit BGR.
/// @param colour float32 [H,W,3] RGB, premultiplied by alpha @param alpha float32 [H,W] @param behind 8-bit BGR, H x W
cv::Mat image_over(const torch::Tensor& colour, const torch::Tensor& alpha, const cv::Mat& behind);

}  // namespace doppel
