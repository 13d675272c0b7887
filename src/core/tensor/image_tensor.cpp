#include "doppel/core/tensor/image_tensor.h"

#include <ATen/Parallel.h>

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

namespace {

void check_image(const cv::Mat& image) {
  if (image.dims == 2 && image.type() == CV_8UC3) return;
  fail<UsageError>("an image must have three channels of 8 bits, found {}",
                   image.empty() ? "no image" : cv::typeToString(image.type()));
}

}  // namespace

torch::Tensor bytes_of(const cv::Mat& image) {
  check_image(image);
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  const auto keep = [whole](void*) {};  // the memory lives as long as the tensor
  return torch::from_blob(whole.data, {whole.rows, whole.cols, 3}, keep, torch::kUInt8);
}

torch::Tensor tensor_of(const cv::Mat& image) { return bytes_of(image).flip(-1).to(torch::kFloat32).div_(255); }

cv::Mat image_view(const torch::Tensor& pixels) {
  const int depth = pixels.scalar_type() == torch::kUInt8 ? CV_8U : CV_32F;
  const int channels = pixels.dim() == 3 ? static_cast<int>(pixels.size(2)) : 1;
  return cv::Mat(static_cast<int>(pixels.size(0)), static_cast<int>(pixels.size(1)), CV_MAKETYPE(depth, channels),
                 pixels.data_ptr());
}

cv::Mat image_of(const torch::Tensor& colour) {
  return image_view((colour.clamp(0, 1) * 255 + 0.5).to(torch::kUInt8).flip(-1).contiguous()).clone();
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
  check_image(behind);
  const std::int64_t height = behind.rows, width = behind.cols;
  check_floats("image_over", "colour", colour, {height, width, 3});
  check_floats("image_over", "alpha", alpha, {height, width});
  const torch::Tensor colours = colour.contiguous(), alphas = alpha.contiguous();
  const float *colour_data = colours.data_ptr<float>(), *alpha_data = alphas.data_ptr<float>();
  cv::Mat out(behind.size(), CV_8UC3);
  at::parallel_for(0, behind.rows, 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t y = begin; y < end; ++y) {
      const int row = static_cast<int>(y);
      blend_row(colour_data + 3 * y * width, alpha_data + y * width, behind.ptr(row), behind.cols, out.ptr(row));
    }
  });
  return out;
}

}  // namespace doppel
