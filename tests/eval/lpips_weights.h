#pragma once

#include <torch/types.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "doppel/nets/weights/weights_file.h"

/// Weights of LPIPS for tests: random numbers in the shapes and under the names of the published files.
namespace doppel::test {

/// A convolution of AlexNet and the number of its part in the package lpips.
struct AlexLayer {
  std::string name;
  int slice;
  std::int64_t inputs, outputs, side, stride, padding;
  bool pooled;  ///< max pooling stands before it
};
inline const std::vector<AlexLayer>& alex_layers() {
  static const std::vector<AlexLayer> layers{{"0", 1, 3, 64, 11, 4, 2, false},
                                             {"3", 2, 64, 192, 5, 1, 2, true},
                                             {"6", 3, 192, 384, 3, 1, 1, true},
                                             {"8", 4, 384, 256, 3, 1, 1, false},
                                             {"10", 5, 256, 256, 3, 1, 1, false}};
  return layers;
}

/// For each of the five layers: features.*.weight, features.*.bias, lin*.model.1.weight.
inline NamedWeights random_lpips_weights(std::uint64_t seed) {
  at::Generator draw = at::detail::createCPUGenerator(seed);
  NamedWeights weights;
  for (std::size_t l = 0; l < alex_layers().size(); ++l) {
    const AlexLayer& layer = alex_layers()[l];
    const double deviation = std::sqrt(2.0 / static_cast<double>(layer.inputs * layer.side * layer.side));
    weights.emplace_back("features." + layer.name + ".weight",
                         torch::randn({layer.outputs, layer.inputs, layer.side, layer.side}, draw) * deviation);
    weights.emplace_back("features." + layer.name + ".bias", 0.1 * torch::randn({layer.outputs}, draw));
    weights.emplace_back("lin" + std::to_string(l) + ".model.1.weight", torch::rand({1, layer.outputs, 1, 1}, draw));
  }
  return weights;
}

/// A tensor of the weights; changes of it change the weights.
inline torch::Tensor named(const NamedWeights& weights, const std::string& name) {
  for (const auto& [key, tensor] : weights)
    if (key == name) return tensor;
  return {};
}

}  // namespace doppel::test
