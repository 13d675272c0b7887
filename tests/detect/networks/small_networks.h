#pragma once

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/core/as_size.h"
#include "support/onnx_file.h"

/// Networks whose answers are known: their points are dots of one colour. The input is [1, 3, h, w]; with the usual
/// mean and deviation, colours are 0..1.
namespace doppel::test_networks {

using support::OnnxFile;

/// A black image.
inline cv::Mat black(int width, int height) { return cv::Mat::zeros(height, width, CV_8UC3); }

/// Adds a round dot with the centre (x, y), pixels, first pixel centre at (0.5, 0.5). @param channel 0 is blue
inline void add_dot(cv::Mat& image, int channel, double x, double y, double sigma, double brightness = 250.0) {
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const double d2 = std::pow(column + 0.5 - x, 2) + std::pow(row + 0.5 - y, 2);
      auto& value = image.at<cv::Vec3b>(row, column)[channel];
      value = cv::saturate_cast<std::uint8_t>(value + brightness * std::exp(-0.5 * d2 / (sigma * sigma)));
    }
}

/// Heatmap k of 3 is colour k at every `stride`th pixel.
inline std::string heatmap_net(int width, int height, int stride, float gain = 1.0f) {
  OnnxFile net;
  const int w = (width - 1) / stride + 1, h = (height - 1) / stride + 1;
  net.input("image", {1, 3, height, width}).output("heatmaps", {1, 3, h, w});
  net.floats("w", {3, 3, 1, 1}, {gain, 0, 0, 0, gain, 0, 0, 0, gain});
  net.node("Conv", {"image", "w"}, {"heatmaps"},
           {OnnxFile::ints("kernel_shape", {1, 1}), OnnxFile::ints("strides", {stride, stride})});
  return net.bytes();
}

/// Bins of 3 points: the largest value of colour k in each column (x) and row (y), `ratio` bins for each pixel.
/// @param first, second names of the outputs for x and y
inline std::string simcc_net(int width, int height, int ratio, const std::string& first = "simcc_x",
                             const std::string& second = "simcc_y") {
  OnnxFile net;
  net.input("image", {1, 3, height, width});
  net.output(first, {1, 3, width * ratio}).output(second, {1, 3, height * ratio});
  const auto spread = [&](const std::string& name, int pixels) {
    std::vector<float> values(as_size(pixels) * as_size(pixels * ratio), 0.0f);
    for (int i = 0; i < pixels; ++i) values[i * pixels * ratio + i * ratio] = 1.0f;
    net.floats(name, {pixels, pixels * ratio}, values);
  };
  spread("spread_x", width);
  spread("spread_y", height);
  net.node("ReduceMax", {"image"}, {"columns"}, {OnnxFile::ints("axes", {2}), OnnxFile::integer("keepdims", 0)});
  net.node("ReduceMax", {"image"}, {"rows"}, {OnnxFile::ints("axes", {3}), OnnxFile::integer("keepdims", 0)});
  net.node("MatMul", {"columns", "spread_x"}, {first});
  net.node("MatMul", {"rows", "spread_y"}, {second});
  return net.bytes();
}

/// A linear function of an image's colours: weight (channel, x, y) and a constant.
struct LinearOutput {
  std::function<double(int channel, double x, double y)> weight;
  double constant = 0.0;
};

/// The sum over all pixels of colour * weight, and the constant, for each output. @param x, y of pixel centres
inline void add_linear(OnnxFile& net, const std::string& name, int width, int height,
                       const std::vector<LinearOutput>& outputs) {
  std::vector<float> weights, constants;
  for (const LinearOutput& output : outputs) {
    for (int c = 0; c < 3; ++c)
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) weights.push_back(static_cast<float>(output.weight(c, x + 0.5, y + 0.5)));
    constants.push_back(static_cast<float>(output.constant));
  }
  const int count = static_cast<int>(outputs.size());
  net.floats(name + "_w", {count, 3, height, width}, weights).floats(name + "_b", {count}, constants);
  net.node("Conv", {"image", name + "_w", name + "_b"}, {name}, {OnnxFile::ints("kernel_shape", {height, width})});
}

inline LinearOutput sum_of(int channel, double factor = 1.0, double constant = 0.0) {
  return {[=](int c, double, double) { return c == channel ? factor : 0.0; }, constant};
}
inline LinearOutput x_of(int channel, double factor = 1.0, double constant = 0.0) {
  return {[=](int c, double x, double) { return c == channel ? factor * x : 0.0; }, constant};
}
inline LinearOutput y_of(int channel, double factor = 1.0, double constant = 0.0) {
  return {[=](int c, double, double y) { return c == channel ? factor * y : 0.0; }, constant};
}

/// The outputs as they are: for images with one pixel of the value 255 in each colour, x_of is its x.
inline std::string linear_net(int width, int height, const std::vector<LinearOutput>& outputs,
                              const std::vector<int>& shape) {
  OnnxFile net;
  net.input("image", {1, 3, height, width}).output("values", shape);
  add_linear(net, "sums", width, height, outputs);
  net.integers("shape", {shape.begin(), shape.end()});
  net.node("Reshape", {"sums", "shape"}, {"values"});
  return net.bytes();
}

/// The outputs of a list, divided by the brightness of a colour each: x_of(0) becomes the centre of all that is blue.
/// @param mass the colour of each output
inline std::string centre_net(int width, int height, const std::vector<LinearOutput>& outputs,
                              const std::vector<int>& mass, const std::vector<int>& shape) {
  OnnxFile net;
  net.input("image", {1, 3, height, width}).output("values", shape);
  std::vector<LinearOutput> masses;
  masses.reserve(mass.size());
  for (const int channel : mass) masses.push_back(sum_of(channel, 1.0, 1e-5));  // black images have a centre, too
  add_linear(net, "sums", width, height, outputs);
  add_linear(net, "masses", width, height, masses);
  net.node("Div", {"sums", "masses"}, {"centres"});
  net.integers("shape", {shape.begin(), shape.end()});
  net.node("Reshape", {"centres", "shape"}, {"values"});
  return net.bytes();
}

/// Regressed points: the centres of blue, green and red.
inline std::string centres_net(int width, int height) {
  return centre_net(width, height, {x_of(0), y_of(0), x_of(1), y_of(1), x_of(2), y_of(2)}, {0, 0, 1, 1, 2, 2}, {1, 6});
}

/// Class k is factors[k] * the sum of the colours + constants[k], at every `stride`th pixel.
inline std::string class_net(int width, int height, int stride, const std::vector<float>& factors,
                             const std::vector<float>& constants, const std::string& last = "") {
  OnnxFile net;
  const int n = static_cast<int>(factors.size()), w = (width - 1) / stride + 1, h = (height - 1) / stride + 1;
  std::vector<float> weights;
  for (const float factor : factors) weights.insert(weights.end(), 3, factor);
  net.input("image", {1, 3, height, width}).output("classes", {1, n, h, w});
  net.floats("w", {n, 3, 1, 1}, weights).floats("b", {n}, constants);
  net.node("Conv", {"image", "w", "b"}, {last.empty() ? "classes" : "logits"},
           {OnnxFile::ints("kernel_shape", {1, 1}), OnnxFile::ints("strides", {stride, stride})});
  if (!last.empty()) net.node(last, {"logits"}, {"classes"});
  return net.bytes();
}

/// YOLOX for one class: in each cell of the grids a box in the middle with the given size, in cells; the objectness is
/// the mean of blue in the cell for the grid `alive`, 0 for the others.
inline std::string yolox_net(int width, int height, int alive, double box_width, double box_height) {
  OnnxFile net;
  int cells = 0;
  std::vector<std::string> parts;
  net.input("image", {1, 3, height, width});
  for (const int stride : {8, 16, 32}) {
    const std::string name = "grid" + std::to_string(stride);
    const int count = (width / stride) * (height / stride);
    cells += count;
    std::vector<float> weights(6 * 3 * stride * stride, 0.0f);
    if (stride == alive)
      std::fill_n(weights.begin() + 4 * 3 * stride * stride, stride * stride,
                  1.0f / static_cast<float>(stride * stride));
    net.floats(name + "_w", {6, 3, stride, stride}, weights);
    net.floats(
        name + "_b", {6},
        {0.5f, 0.5f, static_cast<float>(std::log(box_width)), static_cast<float>(std::log(box_height)), 0.0f, 1.0f});
    net.node("Conv", {"image", name + "_w", name + "_b"}, {name},
             {OnnxFile::ints("kernel_shape", {stride, stride}), OnnxFile::ints("strides", {stride, stride})});
    net.integers(name + "_shape", {1, 6, count});
    net.node("Reshape", {name, name + "_shape"}, {name + "_row"});
    parts.push_back(name + "_row");
  }
  net.output("boxes", {1, cells, 6});
  net.node("Concat", parts, {"rows"}, {OnnxFile::integer("axis", 2)});
  net.node("Transpose", {"rows"}, {"boxes"}, {OnnxFile::ints("perm", {0, 2, 1})});
  return net.bytes();
}

}  // namespace doppel::test_networks
