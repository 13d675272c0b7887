#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>

namespace doppel {

/// The bytes of an 8-bit image of three channels, uint8 [H,W,3], in the image's own memory and order of channels.
/// @throws UsageError for another type of image
torch::Tensor bytes_of(const cv::Mat& image);
/// Converts 8-bit BGR to float32 [H,W,3] RGB 0..1. @throws UsageError for another type of image
torch::Tensor tensor_of(const cv::Mat& image);
/// An image in the memory of a tensor. @param pixels uint8 or float32 [H,W] or [H,W,channels], contiguous
cv::Mat image_view(const torch::Tensor& pixels);
/// Converts [H,W,3] RGB, clamped to 0..1, to 8-bit BGR.
cv::Mat image_of(const torch::Tensor& colour);
/// A drawing over an image: colour + (1 - alpha) * behind, clamped to 0..1, as 8-bit BGR.
/// @param colour float32 [H,W,3] RGB, premultiplied by alpha @param alpha float32 [H,W] @param behind 8-bit BGR, H x W
cv::Mat image_over(const torch::Tensor& colour, const torch::Tensor& alpha, const cv::Mat& behind);

}  // namespace doppel
