#include "doppel/layers/image_convolution/image_convolution.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::image_convolution_test {
namespace {

using support::message_of;
using test::is_near;
using ::testing::HasSubstr;
using torch::Tensor;

Tensor random(at::IntArrayRef sizes, uint64_t seed) {
  return torch::randn(sizes, at::detail::createCPUGenerator(seed));
}

struct Case {
  const char* name;
  int64_t batch, first, second, outputs, height, width, kernel;
  bool enlarge;
};

const Case kCases[] = {{"3x3", 2, 5, 0, 6, 9, 70, 3, false},
                       {"3x3 of two images", 1, 3, 4, 7, 20, 33, 3, false},
                       {"3x3 enlarged", 2, 4, 4, 3, 21, 18, 3, true},
                       {"one pixel enlarged", 1, 40, 0, 20, 1, 1, 3, true},
                       {"4x4", 2, 3, 2, 5, 34, 130, 4, false},
                       {"4x4 to one pixel", 1, 17, 0, 9, 2, 2, 4, false},
                       {"4x4 of many rows", 1, 15, 0, 4, 256, 256, 4, false},
                       {"one column", 1, 2, 0, 2, 6, 1, 3, false}};

ImageConvolution layer_of(const Case& c, bool normalised, double slope) {
  ImageConvolution layer;
  layer.weight = random({c.outputs, c.first + c.second, c.kernel, c.kernel}, 3);
  if (normalised) {
    layer.scale = random({c.outputs}, 4);
    layer.shift = random({c.outputs}, 5);
  }
  layer.slope = slope;
  layer.enlarge = c.enlarge;
  return layer;
}

ImageConvolution in_double(ImageConvolution layer) {
  for (Tensor* tensor : {&layer.weight, &layer.scale, &layer.shift})
    if (tensor->defined()) *tensor = tensor->to(torch::kFloat64);
  return layer;
}

TEST(ImageConvolutionAgrees, WithItsReferenceForAllShapes) {
  for (const Case& c : kCases)
    for (const bool normalised : {false, true}) {
      const Tensor image = random({c.batch, c.first, c.height, c.width}, 1);
      const Tensor second = c.second > 0 ? random({c.batch, c.second, c.height, c.width}, 2) : Tensor();
      const ImageConvolution layer = layer_of(c, normalised, normalised ? 0.3 : 1.0);
      const Tensor expected = image_convolution_reference(
          image.to(torch::kFloat64), second.defined() ? second.to(torch::kFloat64) : second, in_double(layer));
      const Tensor found = image_convolution(image, second, layer);
      ASSERT_EQ(found.sizes(), expected.sizes()) << c.name;
      EXPECT_TRUE(is_near(found, expected, 1e-4)) << c.name << (normalised ? ", normalised" : "");
    }
}

TEST(ImageConvolutionAgrees, WithPixelsThatShareMemoryAndWithSlices) {
  const Case c{"", 2, 3, 6, 4, 12, 40, 4, false};
  const Tensor image = random({2, 5, 12, 40}, 1).narrow(1, 1, 3);
  const Tensor second = random({2, 6}, 2).unsqueeze(-1).unsqueeze(-1).expand({2, 6, 12, 40});
  const ImageConvolution layer = layer_of(c, true, 0.0);
  const Tensor expected = image_convolution_reference(image, second, layer);
  EXPECT_TRUE(is_near(image_convolution(image, second, layer), expected, 1e-4));
  // Transposed: neither contiguous nor shared.
  const Tensor turned = random({2, 3, 40, 12}, 1).transpose(2, 3);
  EXPECT_TRUE(
      is_near(image_convolution(turned, second, layer), image_convolution_reference(turned, second, layer), 1e-4));
}

TEST(ImageConvolutionReference, EnlargesByAQuarterAndThreeQuarters) {
  // A kernel that is 1 in its middle shows the enlarged image.
  ImageConvolution layer;
  layer.weight = torch::zeros({1, 1, 3, 3});
  layer.weight[0][0][1][1] = 1.0;
  layer.enlarge = true;
  const Tensor image = torch::tensor({0.0f, 4.0f}).view({1, 1, 1, 2});
  const Tensor expected = torch::tensor({0.0f, 1.0f, 3.0f, 4.0f}).view({1, 1, 1, 4}).expand({1, 1, 2, 4});
  EXPECT_TRUE(is_near(image_convolution_reference(image, {}, layer), expected, 1e-7));
  EXPECT_TRUE(is_near(image_convolution(image, {}, layer), expected, 1e-7));
}

TEST(ImageConvolutionAgrees, BitForBitWhateverTheThreads) {
  const int before = at::get_num_threads();
  for (const Case& c : kCases) {
    const Tensor image = random({c.batch, c.first + c.second, c.height, c.width}, 1);
    const ImageConvolution layer = layer_of(c, true, 0.3);
    at::set_num_threads(1);
    const Tensor one = image_convolution(image, {}, layer);
    at::set_num_threads(3);
    EXPECT_TRUE(torch::equal(one, image_convolution(image, {}, layer))) << c.name;
  }
  at::set_num_threads(before);
}

TEST(ImageConvolutionRejects, WhatItCannotCompute) {
  ImageConvolution layer;
  layer.weight = torch::zeros({2, 3, 4, 4});
  const auto message = [&](const Tensor& image) { return message_of([&] { image_convolution(image, {}, layer); }); };
  EXPECT_THAT(message(torch::zeros({1, 2, 4, 4})), HasSubstr("weight must be"));
  EXPECT_THAT(message(torch::zeros({1, 3, 5, 4})), HasSubstr("must be even"));
  EXPECT_THAT(message(torch::zeros({3, 4, 4})), HasSubstr("image must be"));
  layer.enlarge = true;
  EXPECT_THAT(message(torch::zeros({1, 3, 4, 4})), HasSubstr("not enlarged"));
  layer = {torch::zeros({2, 3, 3, 3}), torch::zeros({3})};
  EXPECT_THAT(message(torch::zeros({1, 3, 4, 4})), HasSubstr("scale must be"));
  EXPECT_EQ(image_convolution(torch::zeros({0, 3, 4, 4}), {}, {torch::zeros({2, 3, 3, 3})}).sizes(),
            (std::vector<int64_t>{0, 2, 4, 4}));
}

}  // namespace
}  // namespace doppel::image_convolution_test
