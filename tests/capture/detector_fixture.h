#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

/// A tiny network in the forms that detectors come in, written byte by byte.
namespace doppel::test_detector {

/// Just enough of the protocol buffers' wire format to write a network.
namespace wire {

inline std::string number(std::uint64_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) bytes += static_cast<char>((value & 127) | 128);
  return bytes + static_cast<char>(value);
}
inline std::string field(int id, std::uint64_t value) { return number(8u * id) + number(value); }
inline std::string field(int id, const std::string& bytes) {
  return number(8u * id + 2) + number(bytes.size()) + bytes;
}
inline std::string floats(const std::vector<float>& values) {
  return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

}  // namespace wire

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
  using wire::field;
  const auto sizes = [](const std::string& name, const std::vector<int>& values) {
    std::string text = field(1, name) + field(20, 7);
    for (const int value : values) text += field(8, static_cast<std::uint64_t>(value));
    return field(5, text);
  };
  const auto value = [](const std::string& name, const std::vector<int>& shape) {
    std::string dims;
    for (const int size : shape) dims += field(1, field(1, static_cast<std::uint64_t>(size)));
    return field(1, name) + field(2, field(1, field(1, std::uint64_t{1}) + field(2, dims)));
  };
  const std::string node = field(1, std::string("picture")) + field(1, std::string("weights")) +
                           field(2, std::string("heatmaps")) + field(3, std::string("conv")) +
                           field(4, std::string("Conv")) + sizes("kernel_shape", {kStride, kStride}) +
                           sizes("strides", {kStride, kStride}) + sizes("pads", {0, 0, 0, 0});
  std::string tensor;
  for (const int size : {kHeatmaps, 3, kStride, kStride}) tensor += field(1, static_cast<std::uint64_t>(size));
  tensor += field(2, std::uint64_t{1}) + field(8, std::string("weights")) + field(9, wire::floats(weights()));
  const std::string graph = field(1, node) + field(2, std::string("net")) + field(5, tensor) +
                            field(11, value("picture", {1, 3, 64, 96})) +
                            field(12, value("heatmaps", {1, kHeatmaps, 8, 12}));
  return field(1, std::uint64_t{7}) + field(7, graph) + field(8, field(2, std::uint64_t{11}));
}

constexpr char kPrototxt[] =
    "name: \"net\"\ninput: \"image\"\ninput_dim: 1\ninput_dim: 3\ninput_dim: 64\ninput_dim: 96\n"
    "layer { name: \"conv\" type: \"Convolution\" bottom: \"image\" top: \"heatmaps\"\n"
    "  convolution_param { num_output: 4 kernel_size: 8 stride: 8 bias_term: false } }\n";

inline std::string caffemodel() {
  using wire::field;
  std::string shape;
  for (const int size : {kHeatmaps, 3, kStride, kStride}) shape += wire::number(static_cast<std::uint64_t>(size));
  const std::string blob = field(5, wire::floats(weights())) + field(7, field(1, shape));
  return field(1, std::string("net")) +
         field(100, field(1, std::string("conv")) + field(2, std::string("Convolution")) + field(7, blob));
}

}  // namespace doppel::test_detector
