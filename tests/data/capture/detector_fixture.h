#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "support/onnx_file.h"

/// A tiny network in the forms that detectors come in, written byte by byte.
namespace doppel::test_detector {

constexpr int kHeatmaps = 4, kStride = 8;

/// A convolution of stride 8 whose heatmap k is the mean of colour k (blue, green, red) over its 8x8 pixels; the fourth
/// stands for the background.
inline std::vector<float> weights() {
  std::vector<float> values(kHeatmaps * 3 * kStride * kStride, 0.0f);
  for (int k = 0; k < 3; ++k)
    std::fill_n(values.begin() + (3 * k + k) * kStride * kStride, kStride * kStride, 1.0f / (kStride * kStride));
  return values;
}

inline std::string onnx_net() {
  using support::OnnxFile;
  OnnxFile net;
  net.input("picture", {1, 3, 64, 96}).output("heatmaps", {1, kHeatmaps, 8, 12});
  net.floats("weights", {kHeatmaps, 3, kStride, kStride}, weights());
  net.node("Conv", {"picture", "weights"}, {"heatmaps"},
           {OnnxFile::ints("kernel_shape", {kStride, kStride}), OnnxFile::ints("strides", {kStride, kStride}),
            OnnxFile::ints("pads", {0, 0, 0, 0})});
  return net.bytes();
}

constexpr char kPrototxt[] =
    "name: \"net\"\ninput: \"image\"\ninput_dim: 1\ninput_dim: 3\ninput_dim: 64\ninput_dim: 96\n"
    "layer { name: \"conv\" type: \"Convolution\" bottom: \"image\" top: \"heatmaps\"\n"
    "  convolution_param { num_output: 4 kernel_size: 8 stride: 8 bias_term: false } }\n";

inline std::string caffemodel() {
  using namespace support::wire;
  std::string shape;
  for (const int size : {kHeatmaps, 3, kStride, kStride}) shape += number(static_cast<std::uint64_t>(size));
  const std::string blob = field(5, raw(weights())) + field(7, field(1, shape));
  return field(1, std::string("net")) +
         field(100, field(1, std::string("conv")) + field(2, std::string("Convolution")) + field(7, blob));
}

}  // namespace doppel::test_detector
