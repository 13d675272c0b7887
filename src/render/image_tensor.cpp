#include "doppel/render/image_tensor.h"

#include <ATen/Parallel.h>
#include <torch/types.h>

#include <algorithm>

namespace doppel {

torch::Tensor tensor_of(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  return torch::from_blob(whole.data, {whole.rows, whole.cols, 3}, torch::kUInt8).to(torch::kFloat32).flip(-1) / 255;
}

cv::Mat image_of(const torch::Tensor& colour) {
  const torch::Tensor bytes = (colour.clamp(0, 1) * 255 + 0.5).to(torch::kUInt8).flip(-1).contiguous();
  return cv::Mat(static_cast<int>(bytes.size(0)), static_cast<int>(bytes.size(1)), CV_8UC3, bytes.data_ptr()).clone();
}

namespace {

void blend_row(const float* colour, const float* alpha, const std::uint8_t* behind, int width, std::uint8_t* out) {
  for (int x = 0; x < width; ++x) {
    for (int c = 0; c < 3; ++c) {
      const float value = 255.0f * colour[3 * x + 2 - c] + (1.0f - alpha[x]) * static_cast<float>(behind[3 * x + c]);
      out[3 * x + c] = static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
    }
  }
}

}  // namespace

cv::Mat image_over(const torch::Tensor& colour, const torch::Tensor& alpha, const cv::Mat& behind) {
  TORCH_CHECK(colour.dim() == 3 && alpha.dim() == 2 && behind.type() == CV_8UC3 && colour.size(0) == behind.rows &&
                  colour.size(1) == behind.cols && colour.size(2) == 3 && alpha.size(0) == behind.rows &&
                  alpha.size(1) == behind.cols,
              "image_over: colour ", colour.sizes(), ", alpha ", alpha.sizes(), ", behind ", behind.cols, " x ",
              behind.rows);
  const torch::Tensor colours = colour.contiguous(), alphas = alpha.contiguous();
  const float *colour_data = colours.data_ptr<float>(), *alpha_data = alphas.data_ptr<float>();
  cv::Mat out(behind.size(), CV_8UC3);
  at::parallel_for(0, behind.rows, 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t y = begin; y < end; ++y) {
      const int row = static_cast<int>(y), width = behind.cols;
      blend_row(colour_data + 3 * y * width, alpha_data + y * width, behind.ptr(row), width, out.ptr(row));
    }
  });
  return out;
}

}  // namespace doppel
