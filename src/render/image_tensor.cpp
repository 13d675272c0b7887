#include "doppel/render/image_tensor.h"

#include <torch/types.h>

namespace doppel {

torch::Tensor tensor_of(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  return torch::from_blob(whole.data, {whole.rows, whole.cols, 3}, torch::kUInt8).to(torch::kFloat32).flip(-1) / 255;
}

cv::Mat image_of(const torch::Tensor& colour) {
  const torch::Tensor bytes = (colour.clamp(0, 1) * 255 + 0.5).to(torch::kUInt8).flip(-1).contiguous();
  return cv::Mat(static_cast<int>(bytes.size(0)), static_cast<int>(bytes.size(1)), CV_8UC3, bytes.data_ptr()).clone();
}

}  // namespace doppel
