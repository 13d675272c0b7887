#include "doppel/nets/pose_net.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/nets/def_net.h"
#include "nets/weights_fixture.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::pose_net_test {
namespace {

using support::message_of;
using test::is_near;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

at::Generator seeded(uint64_t seed) { return at::detail::createCPUGenerator(seed); }
Tensor random_images(int64_t batch, int64_t size, uint64_t seed = 5) {
  return torch::randn({batch, 3, size, size}, seeded(seed), torch::kFloat32);
}

int64_t count_parameters(const torch::nn::Module& module) {
  int64_t count = 0;
  for (const Tensor& parameter : module.parameters()) count += parameter.numel();
  return count;
}

std::string shape_of(const torch::nn::Module& module, const std::string& name) {
  for (const auto& [key, tensor] : test::weights_of(module))
    if (key == name) return fmt::format("{}", fmt::join(tensor.sizes(), ","));
  return "missing";
}

TEST(ResNet, HasTheNamesAndShapesOfTorchvision) {
  const ResNet small(ResNetKind::resnet18, seeded(1)), large(ResNetKind::resnet50, seeded(1));
  // torchvision's 11,689,512 and 25,557,032 parameters, less those of the classifier of 1000 classes.
  EXPECT_EQ(count_parameters(*small), 11689512 - 1000 * 513);
  EXPECT_EQ(count_parameters(*large), 25557032 - 1000 * 2049);
  EXPECT_EQ(test::weights_of(*small).size(), 120u);
  EXPECT_EQ(test::weights_of(*large).size(), 318u);
  EXPECT_EQ(shape_of(*small, "conv1.weight"), "64,3,7,7");
  EXPECT_EQ(shape_of(*small, "bn1.running_var"), "64");
  EXPECT_EQ(shape_of(*small, "layer1.0.conv1.weight"), "64,64,3,3");
  EXPECT_EQ(shape_of(*small, "layer1.0.downsample.0.weight"), "missing");
  EXPECT_EQ(shape_of(*small, "layer2.0.downsample.0.weight"), "128,64,1,1");
  EXPECT_EQ(shape_of(*small, "layer2.0.downsample.1.num_batches_tracked"), "");
  EXPECT_EQ(shape_of(*small, "layer4.1.bn2.weight"), "512");
  EXPECT_EQ(shape_of(*large, "layer1.0.downsample.0.weight"), "256,64,1,1");
  EXPECT_EQ(shape_of(*large, "layer1.2.conv3.weight"), "256,64,1,1");
  EXPECT_EQ(shape_of(*large, "layer3.5.conv2.weight"), "256,256,3,3");
  EXPECT_EQ(shape_of(*large, "layer4.0.conv1.weight"), "512,1024,1,1");
}

/// A bottleneck's strides: torchvision halves the image in the 3x3 convolution and in the shortcut.
TEST(ResNet, HalvesTheImageWhereTorchvisionDoes) {
  ResidualUnit unit(4, 2, 8, 2, true);
  unit->eval();
  const torch::NoGradGuard no_grad;
  for (auto& parameter : unit->named_parameters()) {
    if (parameter.value().dim() != 4) continue;
    parameter.value().zero_();
    // Every convolution passes on channel 0; the 3x3 one looks one pixel to the right.
    const int64_t middle = parameter.value().size(3) / 2;
    parameter.value()[0][0][middle][parameter.value().size(3) - 1] = 1.0;
  }
  Tensor image = torch::zeros({1, 4, 6, 6});
  image[0][0] = torch::arange(36, torch::kFloat32).view({6, 6});
  const Tensor out = unit->forward(image);
  ASSERT_EQ(out.sizes(), at::IntArrayRef({1, 8, 3, 3}));
  // Shortcut: pixel (2r, 2c). Convolutions: pixel (2r, 2c+1).
  const float scale = 1.0f / std::sqrt(1.0f + 1e-5f);
  const Tensor rows = 12 * torch::arange(3, torch::kFloat32).unsqueeze(1),
               columns = 2 * torch::arange(3, torch::kFloat32);
  EXPECT_TRUE(is_near(out[0][0], scale * (rows + columns) + scale * scale * scale * (rows + columns + 1), 1e-4));
}

TEST(ResNet, GradientReachesEveryParameter) {
  for (const auto kind : {ResNetKind::resnet18, ResNetKind::resnet50}) {
    ResNet net(kind, seeded(1));
    net->forward(random_images(2, 64)).square().mean().backward();
    for (const auto& parameter : net->named_parameters()) {
      ASSERT_TRUE(parameter.value().grad().defined()) << parameter.key();
      EXPECT_TRUE(parameter.value().grad().isfinite().all().item<bool>()) << parameter.key();
    }
  }
}

TEST(ResNet, RejectsOtherImages) {
  ResNet net(ResNetKind::resnet18, seeded(1));
  EXPECT_THAT(message_of<UsageError>([&] { net->forward(torch::zeros({1, 1, 64, 64})); }), HasSubstr("[1,1,64,64]"));
  EXPECT_THAT(message_of<UsageError>([&] { net->forward(torch::zeros({1, 3, 16, 64})); }), HasSubstr("at least 32"));
}

class Pretrained : public ::testing::Test {
 protected:
  BackboneConfig config() const {
    BackboneConfig config;
    config.kind = ResNetKind::resnet18;
    config.input_size = 64;
    config.pretrained = folder_.path() / "weights";
    return config;
  }
  /// Another network's weights, with a classifier, as torchvision publishes them.
  NamedWeights published(ResNetKind kind) {
    ResNet net(kind, seeded(99));
    net->train();
    net->forward(random_images(4, 64));  // statistics of their own
    NamedWeights weights = test::weights_of(*net);
    weights.emplace_back("fc.weight", torch::zeros({1000, 512}));
    weights.emplace_back("fc.bias", torch::zeros({1000}));
    return weights;
  }
  support::TemporaryFolder folder_;
};

TEST_F(Pretrained, WeightsOfEitherLayoutFit) {
  const NamedWeights weights = published(ResNetKind::resnet18);
  for (const bool safetensors : {false, true}) {
    safetensors ? test::write_safetensors(config().pretrained, weights)
                : test::write_torch_weights(config().pretrained, weights);
    Backbone backbone(config(), 5, torch::arange(5, torch::kFloat32), seeded(1));
    const Tensor head = backbone->named_parameters()["head.weight"].clone();
    backbone->load_pretrained();
    const auto found = test::weights_of(*backbone);
    for (const auto& [name, expected] : weights) {
      const auto entry = std::find_if(found.begin(), found.end(),
                                      [&, key = "resnet." + name](const auto& item) { return item.first == key; });
      if (name.rfind("fc.", 0) == 0) continue;
      ASSERT_NE(entry, found.end()) << name;
      EXPECT_TRUE(torch::equal(entry->second, expected)) << name;
    }
    EXPECT_TRUE(torch::equal(backbone->named_parameters()["head.weight"], head));
  }
}

TEST_F(Pretrained, WeightsOfAnotherArchitectureAreRefused) {
  test::write_torch_weights(config().pretrained, published(ResNetKind::resnet50));
  Backbone backbone(config(), 5, torch::zeros({5}), seeded(1));
  EXPECT_THAT(message_of<FileError>([&] { backbone->load_pretrained(); }),
              AllOf(HasSubstr("another network"), HasSubstr("unexpected: layer1.0.conv3.weight"),
                    HasSubstr("other shapes: layer1.0.conv1.weight [64,64,1,1] instead of [64,64,3,3]")));
}

TEST_F(Pretrained, FrozenStatisticsStayWhileTraining) {
  test::write_torch_weights(config().pretrained, published(ResNetKind::resnet18));
  BackboneConfig frozen = config();
  frozen.freeze_norm = true;
  Backbone backbone(frozen, 5, torch::zeros({5}), seeded(1));
  backbone->load_pretrained();
  backbone->train();
  const Tensor before = backbone->named_buffers()["resnet.bn1.running_mean"].clone();
  const Tensor together = backbone->forward(random_images(2, 64)),
               alone = backbone->forward(random_images(2, 64).narrow(0, 0, 1));
  EXPECT_TRUE(torch::equal(backbone->named_buffers()["resnet.bn1.running_mean"], before));
  EXPECT_TRUE(is_near(together.narrow(0, 0, 1), alone, 1e-5, 1e-5));  // no statistics over the batch
}

PoseNetConfig small_backbone() {
  PoseNetConfig config;
  config.kind = ResNetKind::resnet18;
  config.input_size = 64;
  return config;
}

TEST(PoseNet, StartsInTheMiddleOfTheLimitsUprightAndFacingTheCamera) {
  const PoseDofs pose(test_actor().skeleton, {}, test_actor().rest_dofs);
  PoseNet net(pose, small_backbone());  // in training mode, as it starts: features have the size of 1
  const auto [theta, alpha] = net->forward(random_images(3, 64));
  EXPECT_TRUE(is_near(theta, pose.middle().expand({3, -1}), 0.15));
  EXPECT_TRUE(is_near(alpha, torch::tensor({0.0, M_PI, 0.0}, torch::kFloat64).expand({3, 3}), 0.15));
  EXPECT_GT((theta[0] - theta[1]).abs().max().item<float>(), 0.0f);
}

/// The heading is the angle of a direction, whatever its length: no heading is farther from its neighbours than others.
TEST(PoseNet, HeadingsGoRightRound) {
  const PoseDofs pose(test_actor().skeleton, {}, test_actor().rest_dofs);
  PoseNet net(pose, small_backbone());
  const torch::NoGradGuard no_grad;
  auto parameters = net->named_parameters();
  parameters["backbone.head.weight"].zero_();
  Tensor rotation = parameters["backbone.head.bias"].narrow(0, pose.size(), 4);
  for (const double heading : {-3.1, -1.5, 0.0, 1.5, 3.1}) {
    rotation.copy_(torch::tensor({2.5 * std::cos(heading), 2.5 * std::sin(heading), 3.0, 0.1}));
    const Tensor alpha = net->forward(random_images(2, 64)).second;
    EXPECT_TRUE(is_near(alpha, torch::tensor({heading, 3.0, 0.1}).expand({2, 3}), 1e-5));
  }
}

/// As in the thesis: the last layer outputs alpha itself.
TEST(PoseNet, MayPredictTheHeadingAsAnAngle) {
  const PoseDofs pose(test_actor().skeleton, {}, test_actor().rest_dofs);
  PoseNetConfig config = small_backbone();
  config.heading = HeadingOutput::angle;
  PoseNet net(pose, config);
  const torch::NoGradGuard no_grad;
  EXPECT_TRUE(is_near(net->forward(random_images(3, 64)).second,
                      torch::tensor({0.0, M_PI, 0.0}, torch::kFloat64).expand({3, 3}), 0.15));
  auto parameters = net->named_parameters();
  parameters["backbone.head.weight"].zero_();
  parameters["backbone.head.bias"].narrow(0, pose.size(), 3).copy_(torch::tensor({7.0, 3.0, 0.1}));
  EXPECT_TRUE(is_near(net->forward(random_images(2, 64)).second, torch::tensor({7.0, 3.0, 0.1}).expand({2, 3}), 1e-6));
}

TEST(PoseNet, IsTheSameForTheSameSeed) {
  const PoseDofs pose(test_actor().skeleton, {}, test_actor().rest_dofs);
  PoseNet a(pose, small_backbone(), seeded(4)), b(pose, small_backbone(), seeded(4)),
      c(pose, small_backbone(), seeded(5));
  for (const auto net : {&a, &b, &c}) (*net)->eval();
  const Tensor images = random_images(2, 64);
  EXPECT_TRUE(torch::equal(a->forward(images).first, b->forward(images).first));
  EXPECT_FALSE(torch::equal(a->forward(images).first, c->forward(images).first));
}

TEST(PoseNet, ReadsItsConfiguration) {
  const ConfigDocument document = ConfigDocument::parse(
      "backbone: resnet18\ninput_size: 128\npretrained: weights.pth\nfreeze_norm: true\nhead_scale: 0.01\n"
      "heading: angle\n",
      "c.yaml");
  const ConfigReader reader = document.root();
  const PoseNetConfig config = read_options<PoseNetConfig>(reader);
  reader.finish();
  EXPECT_EQ(config.kind, ResNetKind::resnet18);
  EXPECT_EQ(config.input_size, 128);
  EXPECT_EQ(config.pretrained.filename(), "weights.pth");
  EXPECT_TRUE(config.freeze_norm);
  EXPECT_EQ(config.head_scale, 0.01);
  EXPECT_EQ(config.heading, HeadingOutput::angle);
  EXPECT_THAT(message_of<FileError>(
                  [] { read_options<BackboneConfig>(ConfigDocument::parse("backbone: resnet51\n", "c.yaml").root()); }),
              HasSubstr("resnet50"));
}

TEST(PoseNet, RejectsImagesOfAnotherSize) {
  PoseNet net(PoseDofs(test_actor().skeleton, {}, test_actor().rest_dofs), small_backbone());
  EXPECT_THAT(message_of<UsageError>([&] { net->forward(torch::zeros({1, 3, 96, 96})); }), HasSubstr("[1,3,96,96]"));
}

TEST(DefNet, StartsNearTheUndeformedTemplate) {
  DefNet net(test_actor().num_nodes(), small_backbone());
  const auto [A, T] = net->forward(random_images(2, 64));
  ASSERT_EQ(A.sizes(), at::IntArrayRef({2, test_actor().num_nodes(), 3}));
  ASSERT_EQ(T.sizes(), A.sizes());
  EXPECT_TRUE(is_near(A, torch::zeros_like(A), 0.15));
  EXPECT_TRUE(is_near(T, torch::zeros_like(T), 0.15));
  EXPECT_GT(T.abs().max().item<float>(), 0.0f);
}

}  // namespace
}  // namespace doppel::pose_net_test
