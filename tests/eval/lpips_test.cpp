#include "doppel/eval/lpips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "eval/lpips_weights.h"
#include "nets/weights_fixture.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::lpips_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using test::alex_layers;
using test::AlexLayer;
using test::named;
using test::random_lpips_weights;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using torch::Tensor;

Tensor random_image(std::uint64_t seed, std::int64_t count, std::int64_t height, std::int64_t width) {
  return torch::rand({count, 3, height, width}, at::detail::createCPUGenerator(seed)) * 2.0 - 1.0;
}

double value(const Tensor& number) { return number.item<double>(); }

/// Features of one image in double precision.
struct Map {
  std::int64_t channels, height, width;
  std::vector<double> values;

  Map(std::int64_t c, std::int64_t h, std::int64_t w)
      : channels(c), height(h), width(w), values(static_cast<std::size_t>(c * h * w)) {}
  double& at(std::int64_t c, std::int64_t y, std::int64_t x) {
    return values[static_cast<std::size_t>((c * height + y) * width + x)];
  }
};

Map standardised(const Tensor& image) {
  const double shift[] = {-.030, -.088, -.188}, scale[] = {.458, .448, .450};
  Map result(3, image.size(2), image.size(3));
  const auto pixels = image.accessor<float, 4>();
  for (std::int64_t c = 0; c < 3; ++c)
    for (std::int64_t y = 0; y < result.height; ++y)
      for (std::int64_t x = 0; x < result.width; ++x) result.at(c, y, x) = (pixels[0][c][y][x] - shift[c]) / scale[c];
  return result;
}

Map pooled(Map& in) {
  Map out(in.channels, (in.height - 3) / 2 + 1, (in.width - 3) / 2 + 1);
  for (std::int64_t c = 0; c < out.channels; ++c)
    for (std::int64_t y = 0; y < out.height; ++y)
      for (std::int64_t x = 0; x < out.width; ++x) {
        double most = in.at(c, 2 * y, 2 * x);
        for (int i = 0; i < 9; ++i) most = std::max(most, in.at(c, 2 * y + i / 3, 2 * x + i % 3));
        out.at(c, y, x) = most;
      }
  return out;
}

/// One number of a rectified convolution.
double convolved(Map& in, const AlexLayer& layer, const float* kernel, double bias, std::int64_t y, std::int64_t x) {
  double sum = bias;
  for (std::int64_t c = 0; c < layer.inputs; ++c)
    for (std::int64_t v = 0; v < layer.side; ++v)
      for (std::int64_t u = 0; u < layer.side; ++u, ++kernel) {
        const std::int64_t row = y * layer.stride - layer.padding + v, column = x * layer.stride - layer.padding + u;
        if (row >= 0 && column >= 0 && row < in.height && column < in.width) sum += *kernel * in.at(c, row, column);
      }
  return std::max(sum, 0.0);
}

Map rectified_convolution(Map& in, const AlexLayer& layer, const Tensor& weight, const Tensor& bias) {
  const auto size = [&](std::int64_t n) { return (n + 2 * layer.padding - layer.side) / layer.stride + 1; };
  Map out(layer.outputs, size(in.height), size(in.width));
  const float* kernels = weight.data_ptr<float>();
  for (std::int64_t c = 0; c < out.channels; ++c)
    for (std::int64_t y = 0; y < out.height; ++y)
      for (std::int64_t x = 0; x < out.width; ++x)
        out.at(c, y, x) =
            convolved(in, layer, kernels + c * layer.inputs * layer.side * layer.side, bias.data_ptr<float>()[c], y, x);
  return out;
}

/// The part of one layer in the distance.
double layer_distance(Map& a, Map& b, const float* importance) {
  double sum = 0.0;
  for (std::int64_t y = 0; y < a.height; ++y)
    for (std::int64_t x = 0; x < a.width; ++x) {
      double norm_a = 0.0, norm_b = 0.0;
      for (std::int64_t c = 0; c < a.channels; ++c) {
        norm_a += a.at(c, y, x) * a.at(c, y, x);
        norm_b += b.at(c, y, x) * b.at(c, y, x);
      }
      for (std::int64_t c = 0; c < a.channels; ++c) {
        const double difference = a.at(c, y, x) / std::sqrt(norm_a) - b.at(c, y, x) / std::sqrt(norm_b);
        sum += importance[c] * difference * difference;
      }
    }
  return sum / static_cast<double>(a.height * a.width);
}

double plain_distance(const NamedWeights& weights, const Tensor& image_a, const Tensor& image_b) {
  Map a = standardised(image_a), b = standardised(image_b);
  double sum = 0.0;
  for (std::size_t l = 0; l < alex_layers().size(); ++l) {
    const AlexLayer& layer = alex_layers()[l];
    const std::string name = "features." + layer.name;
    for (Map* map : {&a, &b}) {
      if (layer.pooled) *map = pooled(*map);
      *map = rectified_convolution(*map, layer, named(weights, name + ".weight"), named(weights, name + ".bias"));
    }
    const Tensor importance = named(weights, "lin" + std::to_string(l) + ".model.1.weight");
    sum += layer_distance(a, b, importance.data_ptr<float>());
  }
  return sum;
}

TEST(LpipsReference, SumsWrittenOut) {
  const NamedWeights weights = random_lpips_weights(1);
  const Tensor a = random_image(2, 1, 51, 47), b = 0.5 * a + 0.5 * random_image(3, 1, 51, 47);
  const double expected = plain_distance(weights, a, b);
  EXPECT_GT(expected, 0.01);
  EXPECT_NEAR(value(Lpips(weights, "random").distance(a, b)), expected, 1e-4 * expected);
}

// All convolutions are 0 but one: its first feature is the middle pixel of one colour, its second is 1.
TEST(LpipsReference, PlainColoursInClosedForm) {
  const double shift[] = {-.030, -.088, -.188}, scale[] = {.458, .448, .450};
  for (int colour = 0; colour < 3; ++colour) {
    const NamedWeights weights = random_lpips_weights(1);
    for (const auto& [name, tensor] : weights)
      if (name.rfind("features.", 0) == 0) tensor.zero_();
    named(weights, "features.0.weight")[0][colour][5][5] = 1.0;
    named(weights, "features.0.bias")[1] = 1.0;
    named(weights, "lin0.model.1.weight")[0][0] = 2.0;
    named(weights, "lin0.model.1.weight")[0][1] = 3.0;
    const auto unit = [&](double x) {
      const double feature = (x - shift[colour]) / scale[colour], norm = std::hypot(feature, 1.0);
      return std::pair(feature / norm, 1.0 / norm);
    };
    const auto [a0, a1] = unit(0.9);
    const auto [b0, b1] = unit(0.1);
    const double expected = 2.0 * (a0 - b0) * (a0 - b0) + 3.0 * (a1 - b1) * (a1 - b1);
    Tensor a = torch::zeros({1, 3, 40, 40}), b = torch::zeros({1, 3, 40, 40});
    a[0][colour] = 0.9;
    b[0][colour] = 0.1;
    EXPECT_NEAR(value(Lpips(weights, "one layer").distance(a, b)), expected, 1e-5) << colour;
  }
}

TEST(LpipsReference, EqualImagesHaveNoDistance) {
  const Lpips lpips(random_lpips_weights(1), "random");
  const Tensor image = random_image(2, 2, 40, 33);
  EXPECT_TRUE(torch::equal(lpips.distance(image, image.clone()), torch::zeros({2})));
}

TEST(LpipsReference, BothOrdersAndBatchesAgree) {
  const Lpips lpips(random_lpips_weights(1), "random");
  const Tensor a = random_image(2, 3, 40, 33).requires_grad_(), b = random_image(3, 3, 40, 33);
  const Tensor forth = lpips.distance(a, b), back = lpips.distance(b, a);
  EXPECT_FALSE(forth.requires_grad());
  EXPECT_TRUE(torch::allclose(forth, back, 1e-6, 0.0));
  EXPECT_GT(value(forth.min()), 0.0);
  for (std::int64_t i = 0; i < 3; ++i)
    EXPECT_NEAR(value(lpips.distance(a.narrow(0, i, 1), b.narrow(0, i, 1))), value(forth[i]), 1e-5);
}

TEST(LpipsReference, ScalesAsDefined) {
  const NamedWeights weights = random_lpips_weights(1);
  const Tensor a = random_image(2, 1, 40, 40), b = random_image(3, 1, 40, 40);
  const double before = value(Lpips(weights, "random").distance(a, b));
  // The features of the last layer are divided by their norm, so their scale does not count.
  named(weights, "features.10.weight").mul_(3.0);
  named(weights, "features.10.bias").mul_(3.0);
  EXPECT_NEAR(value(Lpips(weights, "scaled features").distance(a, b)), before, 1e-5 * before);
  for (int l = 0; l < 5; ++l) named(weights, "lin" + std::to_string(l) + ".model.1.weight").mul_(2.0);
  EXPECT_NEAR(value(Lpips(weights, "scaled weights").distance(a, b)), 2.0 * before, 2e-5 * before);
}

TEST(LpipsReference, ImagesOfEightBits) {
  const Lpips lpips(random_lpips_weights(1), "random");
  cv::Mat both(40, 70, CV_8UC3);
  cv::RNG(7).fill(both, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat a = both(cv::Rect(0, 0, 35, 40)), b = both(cv::Rect(35, 0, 35, 40));  // rows with gaps
  const auto tensor_of = [](const cv::Mat& image) {
    Tensor result = torch::empty({1, 3, image.rows, image.cols});
    auto values = result.accessor<float, 4>();
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x)
        for (int c = 0; c < 3; ++c)
          values[0][c][y][x] = static_cast<float>(2.0 * image.at<cv::Vec3b>(y, x)[c] / 255.0 - 1.0);
    return result;
  };
  const double expected = value(lpips.distance(tensor_of(a), tensor_of(b)));
  EXPECT_NEAR(lpips.distance(a, b), expected, 1e-5 * expected);
  EXPECT_EQ(lpips.distance(a, a.clone()), 0.0);
}

/// The weights under the names of the package lpips, with the tensors that its files hold besides.
NamedWeights package_weights(const NamedWeights& weights) {
  NamedWeights result{{"scaling_layer.shift", torch::zeros({1, 3, 1, 1})}};
  for (const auto& [name, tensor] : weights) {
    std::string other = name;
    for (const AlexLayer& layer : alex_layers())
      if (name.rfind("features." + layer.name + ".", 0) == 0)
        other = "net.slice" + std::to_string(layer.slice) + "." + name.substr(std::string("features.").size());
    result.emplace_back(other, tensor);
  }
  result.emplace_back("lins.0.model.1.weight", named(weights, "lin0.model.1.weight"));
  return result;
}

TEST(LpipsReference, OneFileAndTwoFilesAgree) {
  const TemporaryFolder folder;
  const NamedWeights weights = random_lpips_weights(1);
  NamedWeights alexnet{{"classifier.6.bias", torch::zeros({1000})}}, layers;
  for (const auto& item : weights) (item.first[0] == 'f' ? alexnet : layers).push_back(item);
  test::write_torch_weights(folder / "all.pth", package_weights(weights));
  test::write_safetensors(folder / "alexnet.safetensors", alexnet);
  test::write_torch_weights(folder / "layers.pth", layers);
  const Tensor a = random_image(2, 1, 40, 40), b = random_image(3, 1, 40, 40);
  const Tensor expected = Lpips(weights, "memory").distance(a, b);
  EXPECT_TRUE(torch::equal(Lpips::load({folder / "all.pth"}).distance(a, b), expected));
  const Lpips two = Lpips::load({folder / "alexnet.safetensors", folder / "layers.pth"});
  EXPECT_TRUE(torch::equal(two.distance(a, b), expected));
  EXPECT_THAT(two.source(), AllOf(HasSubstr("alexnet.safetensors, "), HasSubstr("layers.pth")));
}

TEST(LpipsRejects, WeightsThatAreNotThere) {
  const TemporaryFolder folder;
  NamedWeights layers;
  for (const auto& item : random_lpips_weights(1))
    if (item.first != "lin3.model.1.weight" && item.first != "features.8.bias") layers.push_back(item);
  test::write_torch_weights(folder / "some.pth", layers);
  EXPECT_THAT(message_of<FileError>([&] { Lpips::load({folder / "some.pth"}); }),
              AllOf(HasSubstr("some.pth"), HasSubstr("missing: features.8.bias, lin3.model.1.weight)"),
                    HasSubstr("lpips.LPIPS(net=\"alex\")"), Not(HasSubstr("other shapes"))));
  EXPECT_THAT(message_of<UsageError>([] { Lpips::load({}); }), HasSubstr("no weights"));
  EXPECT_THAT(message_of<FileError>([&] { Lpips::load({folder / "none.pth"}); }), HasSubstr("none.pth"));
}

TEST(LpipsRejects, WeightsOfAnotherNetwork) {
  NamedWeights weights = random_lpips_weights(1);
  for (auto& [name, tensor] : weights)
    if (name == "features.3.weight") tensor = torch::zeros({128, 64, 3, 3});
  EXPECT_THAT(message_of<FileError>([&] { Lpips(weights, "vgg.pth"); }),
              AllOf(HasSubstr("vgg.pth"), HasSubstr("features.3.weight [128,64,3,3] instead of [192,64,5,5]")));
  const NamedWeights negative = random_lpips_weights(1);
  named(negative, "lin2.model.1.weight")[0][17] = -0.1;
  EXPECT_THAT(message_of<FileError>([&] { Lpips(negative, "bad.pth"); }),
              AllOf(HasSubstr("lin2.model.1.weight"), HasSubstr("not negative")));
}

TEST(LpipsRejects, ImagesThatDoNotFit) {
  const Lpips lpips(random_lpips_weights(1), "random");
  const auto complaint = [&](const Tensor& a, const Tensor& b) {
    return message_of<UsageError>([&] { lpips.distance(a, b); });
  };
  EXPECT_THAT(complaint(random_image(1, 1, 30, 40), random_image(1, 1, 30, 40)), HasSubstr("at least 31 pixels"));
  EXPECT_NO_THROW(lpips.distance(random_image(1, 1, 31, 31), random_image(2, 1, 31, 31)));
  EXPECT_THAT(complaint(random_image(1, 1, 40, 40), random_image(1, 1, 40, 41)), HasSubstr("[B,3,H,W]"));
  EXPECT_THAT(complaint(random_image(1, 1, 40, 40)[0], random_image(1, 1, 40, 40)), HasSubstr("[B,3,H,W]"));
  const cv::Mat grey(40, 40, CV_8UC1, cv::Scalar(1));
  EXPECT_THAT(message_of<UsageError>([&] { lpips.distance(grey, grey); }), HasSubstr("CV_8UC1"));
}

}  // namespace
}  // namespace doppel::lpips_test
