#include "doppel/detect/blazepose/network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "detect/blazepose/small_model.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::network_test {
namespace {

using support::SmallModel;
using Op = tflite::BuiltinOperator;
using Values = std::vector<float>;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using ::testing::Pointwise;

Values random_values(std::size_t count, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  Values values(count);
  for (float& value : values) value = uniform(generator);
  return values;
}

NetworkModel model_of(const std::string& file) {
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "small.tflite", file);
  return read_tflite(folder / "small.tflite");
}

Values run_network(const std::string& file, const Values& input, std::size_t output = 0) {
  Network network(model_of(file), 1);
  EXPECT_EQ(network.input().size(), input.size());
  std::copy(input.begin(), input.end(), network.input().begin());
  network.run();
  const auto result = network.output(output);
  return {result.begin(), result.end()};
}

/// An image [height, width, channels] with one batch.
struct Image {
  int height, width, channels;
  Values values;

  Image(int h, int w, int c, Values v) : height(h), width(w), channels(c), values(std::move(v)) {}
  Image(int h, int w, int c, unsigned seed) : Image(h, w, c, random_values(std::size_t(h) * w * c, seed)) {}
  Image(int h, int w, int c, const std::function<float(int y, int x, int channel)>& f) : Image(h, w, c, Values()) {
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        for (int k = 0; k < c; ++k) values.push_back(f(y, x, k));
  }
  bool holds(int y, int x) const { return y >= 0 && x >= 0 && y < height && x < width; }
  float at(int y, int x, int channel) const {
    return holds(y, x) ? values[std::size_t((y * width + x) * channels + channel)] : 0;
  }
  std::vector<int> shape() const { return {1, height, width, channels}; }
};

struct WindowCase {
  int height, width, kernel_height, kernel_width, stride_y, stride_x;
  bool same;
  int before_y, before_x;  ///< zeros above and to the left, as TensorFlow puts them
};
// 3x3 with stride 2 on an even size: no zero before, one after; on an odd size one on both sides.
// The first and the last have windows of one pixel, which pooling refuses.
const WindowCase kWindows[] = {{5, 6, 1, 1, 1, 1, false, 0, 0}, {5, 6, 3, 3, 1, 1, true, 1, 1},
                               {6, 8, 3, 3, 2, 2, true, 0, 0},  {7, 9, 3, 3, 2, 2, true, 1, 1},
                               {8, 7, 3, 2, 2, 1, false, 0, 0}, {8, 8, 5, 5, 2, 2, true, 1, 1},
                               {5, 5, 2, 2, 1, 1, true, 0, 0},  {6, 5, 1, 1, 2, 3, false, 0, 0}};

int windows(int size, int kernel, int stride, bool same) {
  return same ? (size + stride - 1) / stride : (size - kernel) / stride + 1;
}

class NetworkWindows : public ::testing::TestWithParam<WindowCase> {
 protected:
  int rows() const { return windows(p_.height, p_.kernel_height, p_.stride_y, p_.same); }
  int columns() const { return windows(p_.width, p_.kernel_width, p_.stride_x, p_.same); }
  /// Calls `term` with each element of the window of an output: its position in the kernel and in the input.
  void each(int y, int x, const std::function<void(int ky, int kx, int iy, int ix)>& term) const {
    for (int ky = 0; ky < p_.kernel_height; ++ky)
      for (int kx = 0; kx < p_.kernel_width; ++kx)
        term(ky, kx, y * p_.stride_y + ky - p_.before_y, x * p_.stride_x + kx - p_.before_x);
  }
  template <typename Options>
  Options options() const {
    Options result;
    result.padding = p_.same ? tflite::Padding::SAME : tflite::Padding::VALID;
    result.stride_h = p_.stride_y;
    result.stride_w = p_.stride_x;
    return result;
  }
  WindowCase p_ = GetParam();
};

TEST_P(NetworkWindows, Conv2dIsTheSumOverItsWindow) {
  const int inputs = 3, outputs = 5;
  const Image image(p_.height, p_.width, inputs, 1);
  const Values weights = random_values(std::size_t(outputs) * p_.kernel_height * p_.kernel_width * inputs, 2),
               bias = random_values(outputs, 3);
  const Image expected(rows(), columns(), outputs, [&](int y, int x, int o) {
    double sum = bias[std::size_t(o)];
    each(y, x, [&](int ky, int kx, int iy, int ix) {
      for (int i = 0; i < inputs; ++i)
        sum += weights[std::size_t(((o * p_.kernel_height + ky) * p_.kernel_width + kx) * inputs + i)] *
               image.at(iy, ix, i);
    });
    return std::clamp(static_cast<float>(sum), 0.0f, 6.0f);
  });
  SmallModel model;
  auto conv = options<tflite::Conv2DOptionsT>();
  conv.activation = tflite::Activation::RELU6;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  model.step(Op::CONV_2D,
             {in, model.constant({outputs, p_.kernel_height, p_.kernel_width, inputs}, weights),
              model.constant({outputs}, bias)},
             out, conv);
  EXPECT_THAT(run_network(model.file({in}, {out}), image.values), Pointwise(FloatNear(1e-5f), expected.values));
}

TEST_P(NetworkWindows, DepthwiseConv2dHasOneFilterForEachChannel) {
  const int channels = 19;
  const Image image(p_.height, p_.width, channels, 4);
  const Values weights = random_values(std::size_t(p_.kernel_height) * p_.kernel_width * channels, 5),
               bias = random_values(channels, 6);
  const Image expected(rows(), columns(), channels, [&](int y, int x, int c) {
    double sum = bias[std::size_t(c)];
    each(y, x, [&](int ky, int kx, int iy, int ix) {
      sum += weights[std::size_t((ky * p_.kernel_width + kx) * channels + c)] * image.at(iy, ix, c);
    });
    return static_cast<float>(sum);
  });
  SmallModel model;
  auto conv = options<tflite::DepthwiseConv2DOptionsT>();
  conv.depth_multiplier = 1;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  model.step(
      Op::DEPTHWISE_CONV_2D,
      {in, model.constant({1, p_.kernel_height, p_.kernel_width, channels}, weights), model.constant({channels}, bias)},
      out, conv);
  EXPECT_THAT(run_network(model.file({in}, {out}), image.values), Pointwise(FloatNear(1e-5f), expected.values));
}

class NetworkPooling : public NetworkWindows {};

TEST_P(NetworkPooling, MaxPool2dIsTheLargestOfItsWindow) {
  const Image image(p_.height, p_.width, 7, 7);
  const Image expected(rows(), columns(), 7, [&](int y, int x, int c) {
    float largest = -INFINITY;
    each(y, x, [&](int, int, int iy, int ix) {
      if (image.holds(iy, ix)) largest = std::max(largest, image.at(iy, ix, c));
    });
    return largest;
  });
  SmallModel model;
  auto pool = options<tflite::Pool2DOptionsT>();
  pool.filter_height = p_.kernel_height;
  pool.filter_width = p_.kernel_width;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  model.step(Op::MAX_POOL_2D, {in}, out, pool);
  EXPECT_EQ(run_network(model.file({in}, {out}), image.values), expected.values);
}

INSTANTIATE_TEST_SUITE_P(Windows, NetworkWindows, ::testing::ValuesIn(kWindows));
INSTANTIATE_TEST_SUITE_P(Windows, NetworkPooling, ::testing::ValuesIn(kWindows + 1, std::end(kWindows) - 1));

TEST(Network, AddClampsItsSum) {
  const Image image(3, 4, 5, 8);
  const Values other = random_values(60, 9);
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(image.shape());
  tflite::AddOptionsT options;
  options.activation = tflite::Activation::RELU;
  model.step(Op::ADD, {in, model.constant(image.shape(), other)}, out, options);
  const Values found = run_network(model.file({in}, {out}), image.values);
  for (std::size_t i = 0; i < 60; ++i) EXPECT_FLOAT_EQ(found[i], std::max(0.0f, image.values[i] + other[i]));
}

TEST(Network, PreluMultipliesNegativeValuesByTheFactorOfTheirChannel) {
  const int channels = 19;
  const Image image(3, 4, channels, 18);
  const Values factors = random_values(std::size_t(channels), 19);
  const Image expected(3, 4, channels, [&](int y, int x, int c) {
    const float value = image.at(y, x, c);
    return value < 0 ? factors[std::size_t(c)] * value : value;
  });
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(image.shape());
  model.step(Op::PRELU, {in, model.constant({1, 1, channels}, factors)}, out);
  EXPECT_THAT(run_network(model.file({in}, {out}), image.values), Pointwise(FloatNear(1e-6f), expected.values));
}

TEST(Network, PreluFollowsAConvolutionInItsLayout) {
  const int channels = 32;
  const Image image(6, 5, channels, 20);
  const Values factors = random_values(std::size_t(channels), 21), weights = random_values(std::size_t(channels), 22);
  const Image expected(6, 5, channels, [&](int y, int x, int c) {
    const float value = weights[std::size_t(c)] * image.at(y, x, c);
    return value < 0 ? factors[std::size_t(c)] * value : value;
  });
  SmallModel model;
  tflite::DepthwiseConv2DOptionsT conv;
  conv.stride_w = conv.stride_h = conv.depth_multiplier = 1;
  const int in = model.tensor(image.shape()), scaled = model.tensor(image.shape()), out = model.tensor(image.shape());
  model.step(Op::DEPTHWISE_CONV_2D,
             {in, model.constant({1, 1, 1, channels}, weights),
              model.constant({channels}, Values(std::size_t(channels), 0.0f))},
             scaled, conv);
  model.step(Op::PRELU, {scaled, model.constant({1, 1, channels}, factors)}, out);
  EXPECT_THAT(run_network(model.file({in}, {out}), image.values), Pointwise(FloatNear(1e-6f), expected.values));
}

TEST(Network, FullyConnectedIsTheClampedProductWithItsWeights) {
  const int inputs = 19, outputs = 7;
  const Values x = random_values(inputs, 14), weights = random_values(std::size_t(inputs) * outputs, 15),
               bias = random_values(outputs, 16);
  SmallModel model;
  const int in = model.tensor({1, inputs}), out = model.tensor({1, outputs});
  tflite::FullyConnectedOptionsT options;
  options.activation = tflite::Activation::RELU_N1_TO_1;
  model.step(Op::FULLY_CONNECTED, {in, model.constant({outputs, inputs}, weights), model.constant({outputs}, bias)},
             out, options);
  const Values found = run_network(model.file({in}, {out}), x);
  ASSERT_EQ(found.size(), std::size_t(outputs));
  for (std::size_t o = 0; o < found.size(); ++o) {
    double sum = bias[o];
    for (std::size_t i = 0; i < x.size(); ++i) sum += weights[o * x.size() + i] * x[i];
    EXPECT_NEAR(found[o], std::clamp(sum, -1.0, 1.0), 1e-5) << o;
  }
}

/// @param shape of the result
Values mean_over_rows_and_columns(const Image& image, const std::vector<std::int32_t>& axes,
                                  const std::vector<int>& shape) {
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(shape);
  model.step(Op::MEAN, {in, model.integers({2}, axes)}, out);
  return run_network(model.file({in}, {out}), image.values);
}

TEST(Network, MeanIsOverRowsAndColumns) {
  const Image image(3, 5, 19, 17);
  Values expected(19, 0.0f);
  for (std::size_t i = 0; i < image.values.size(); ++i) expected[i % 19] += image.values[i] / 15;
  EXPECT_THAT(mean_over_rows_and_columns(image, {1, 2}, {1, 19}), Pointwise(FloatNear(1e-6f), expected));
  EXPECT_THAT(mean_over_rows_and_columns(image, {-2, -3}, {1, 1, 1, 19}), Pointwise(FloatNear(1e-6f), expected));
}

TEST(Network, PadAddsZerosOnEveryAxis) {
  const Image image(2, 3, 4, 10);
  const Image expected(6, 4, 11, [&](int y, int x, int c) { return c >= 2 && c < 6 ? image.at(y - 1, x, c - 2) : 0; });
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  model.step(Op::PAD, {in, model.integers({4, 2}, {0, 0, 1, 3, 0, 1, 2, 5})}, out);
  EXPECT_EQ(run_network(model.file({in}, {out}), image.values), expected.values);
}

TEST(Network, ResizeBilinearHasHalfPixelCentres) {
  const Image image(3, 4, 2, 11);
  const Image expected(6, 8, 2, [&](int y, int x, int c) {
    const float v = std::clamp((y + 0.5f) / 2 - 0.5f, 0.0f, 2.0f), u = std::clamp((x + 0.5f) / 2 - 0.5f, 0.0f, 3.0f);
    const int top = std::min(static_cast<int>(v), 1), left = std::min(static_cast<int>(u), 2);
    const float b = v - static_cast<float>(top), a = u - static_cast<float>(left);
    return (1 - b) * ((1 - a) * image.at(top, left, c) + a * image.at(top, left + 1, c)) +
           b * ((1 - a) * image.at(top + 1, left, c) + a * image.at(top + 1, left + 1, c));
  });
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  tflite::ResizeBilinearOptionsT options;
  options.half_pixel_centers = true;
  model.step(Op::RESIZE_BILINEAR, {in, model.integers({2}, {6, 8})}, out, options);
  EXPECT_THAT(run_network(model.file({in}, {out}), image.values), Pointwise(FloatNear(1e-6f), expected.values));
}

TEST(Network, LogisticIsTheSigmoid) {
  SmallModel model;
  const int in = model.tensor({1, 5}), out = model.tensor({1, 5});
  model.step(Op::LOGISTIC, {in}, out);
  const Values x{-80, -2, 0, 0.5f, 30}, found = run_network(model.file({in}, {out}), x);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(found[i], 1 / (1 + std::exp(-static_cast<double>(x[i]))), 1e-6);
}

TEST(Network, DepthToSpaceOrdersChannelsByRowColumnChannel) {
  const Image image(2, 3, 12, 12);
  const Image expected(4, 6, 3,
                       [&](int y, int x, int c) { return image.at(y / 2, x / 2, (y % 2 * 2 + x % 2) * 3 + c); });
  SmallModel model;
  const int in = model.tensor(image.shape()), out = model.tensor(expected.shape());
  tflite::DepthToSpaceOptionsT options;
  options.block_size = 2;
  model.step(Op::DEPTH_TO_SPACE, {in}, out, options);
  EXPECT_EQ(run_network(model.file({in}, {out}), image.values), expected.values);
}

TEST(Network, ReshapeAndConcatenationKeepTheOrderOfValues) {
  const Image image(2, 2, 3, 13);
  SmallModel model;
  const int in = model.tensor(image.shape()), list = model.tensor({1, 4, 3}),
            more = model.constant({1, 1, 3}, {7, 8, 9});
  const int out = model.tensor({1, 9, 3});
  model.step(Op::RESHAPE, {in, model.integers({3}, {1, 4, 3})}, list);
  tflite::ConcatenationOptionsT options;
  options.axis = -2;
  model.step(Op::CONCATENATION, {list, more, list}, out, options);
  Values expected = image.values;
  expected.insert(expected.end(), {7, 8, 9});
  expected.insert(expected.end(), image.values.begin(), image.values.end());
  EXPECT_EQ(run_network(model.file({in}, {out}), image.values), expected);
}

TEST(Network, AnIntermediateResultMayBeAnOutputToo) {
  SmallModel model;
  const int in = model.tensor({1, 4}), half = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::LOGISTIC, {in}, half);
  model.step(Op::ADD, {half, half}, out, tflite::AddOptionsT());
  const std::string file = model.file({in}, {out, half});
  const Values twice = run_network(file, {-1, 0, 1, 2}), once = run_network(file, {-1, 0, 1, 2}, 1);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_FLOAT_EQ(twice[i], 2 * once[i]);
}

TEST(Network, RefusesZeroThreads) {
  SmallModel model;
  const int in = model.tensor({1, 5}), out = model.tensor({1, 5});
  model.step(Op::LOGISTIC, {in}, out);
  const NetworkModel read = model_of(model.file({in}, {out}));
  EXPECT_THAT(support::message_of<UsageError>([&] { Network(read, 0); }), HasSubstr("allowed is 1 to 64"));
}

TEST(Network, RefusesTwoInputs) {
  SmallModel model;
  const int a = model.tensor({1, 4}), b = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::ADD, {a, b}, out, tflite::AddOptionsT());
  const NetworkModel read = model_of(model.file({a, b}, {out}));
  EXPECT_THAT(support::message_of<FileError>([&] { Network(read, 1); }), HasSubstr("has 2 inputs, expected 1"));
}

}  // namespace
}  // namespace doppel::network_test
