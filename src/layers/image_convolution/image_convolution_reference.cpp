#include <ATen/ATen.h>

#include "doppel/layers/image_convolution/image_convolution.h"

namespace doppel {

using torch::Tensor;

Tensor image_convolution_reference(const Tensor& image, const Tensor& second, const ImageConvolution& layer) {
  Tensor x = second.defined() ? at::cat({image, second}, 1) : image;
  if (layer.enlarge) x = at::upsample_bilinear2d(x, c10::nullopt, false, std::vector<double>{2.0, 2.0});
  Tensor y = at::conv2d(x, layer.weight, {}, layer.weight.size(2) == 4 ? 2 : 1, 1);
  if (layer.scale.defined()) y = y * layer.scale.view({1, -1, 1, 1});
  if (layer.shift.defined()) y = y + layer.shift.view({1, -1, 1, 1});
  return layer.slope == 1.0 ? y : at::leaky_relu(y, layer.slope);
}

}  // namespace doppel
