#include "doppel/nets/tex_net.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/csrc/jit/runtime/graph_executor.h>
#include <torch/optim/adam.h>
#include <torch/serialize.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <sstream>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::tex_net_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;
using torch::Tensor;

TexNetConfig small_config() {
  TexNetConfig config;
  config.size = 32;
  config.unet.width = 0.25;
  return config;
}

at::Generator seeded(uint64_t seed) { return at::detail::createCPUGenerator(seed); }
/// The channels of the normals, then those of the camera.
TexNetInput split(const Tensor& channels) {
  return {channels.narrow(1, 0, channels.size(1) - 6), channels.narrow(1, channels.size(1) - 6, 6)};
}
Tensor random_channels(const TexNetConfig& config, int64_t batch) {
  return torch::randn({batch, config.num_inputs(), config.size, config.size}, seeded(4));
}
TexNetInput random_input(const TexNetConfig& config, int64_t batch) { return split(random_channels(config, batch)); }
double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

TEST(UNetReference, HasTheLayersOfPix2pixForEverySize) {
  UNetConfig config;
  for (const auto& [levels, last] : {std::pair{4, 128}, {8, 512}, {10, 512}}) {
    config.levels = levels;
    EXPECT_EQ(config.channels(levels - 1), last);
  }
  EXPECT_EQ(config.channels(0), 16);
  config.levels = 10;
  config.width = 0.125;
  UNet net(15, 3, config);
  const auto shape = [&](const char* name) { return net->named_parameters()[name].sizes().vec(); };
  EXPECT_EQ(shape("down0.weight"), (std::vector<int64_t>{2, 15, 4, 4}));
  EXPECT_EQ(shape("down9.weight"), (std::vector<int64_t>{64, 64, 4, 4}));
  EXPECT_EQ(shape("up9.weight"), (std::vector<int64_t>{64, 64, 4, 4}));
  EXPECT_EQ(shape("up8.weight"), (std::vector<int64_t>{128, 64, 4, 4}));
  EXPECT_EQ(shape("up1.weight"), (std::vector<int64_t>{8, 2, 4, 4}));
  EXPECT_EQ(shape("up0.weight"), (std::vector<int64_t>{4, 3, 4, 4}));
  EXPECT_FALSE(net->named_parameters().contains("down0.bias"));
  EXPECT_FALSE(net->named_parameters().contains("down_norm0.weight"));
  EXPECT_NEAR(net->named_parameters()["down6.weight"].std().item<double>(), 0.02, 1e-3);
}

TEST(UNetGradient, MatchesCentralDifferences) {
  for (const Upsampling upsample : {Upsampling::transposed, Upsampling::bilinear_conv}) {
    UNetConfig config;
    config.levels = 2;
    config.width = 0.125;
    config.upsample = upsample;
    config.dropout = 0.0;
    UNet net(2, 2, config);
    net->to(torch::kFloat64);
    {
      torch::NoGradGuard no_grad;
      auto generator = seeded(8);
      // Larger weights than the initial ones, so that the skip connections and the norms matter.
      for (Tensor& parameter : net->parameters()) parameter.normal_(0.0, 0.5, generator);
    }
    test::GradientOptions options;
    options.relative = 1e-4;
    options.absolute = 1e-6;
    for (const bool training : {true, false}) {
      net->train(training);
      EXPECT_TRUE(test::gradients_match([&](const std::vector<Tensor>& x) { return net->forward(x[0]); },
                                        {{"image", torch::randn({2, 2, 8, 8}, seeded(9), torch::kFloat64)}}, options));
    }
  }
}

TEST(TransposedConvolutionAgrees, WithTheOneOfTorchInValueAndGradient) {
  auto generator = seeded(3);
  for (const auto& [height, width] : {std::pair{1, 1}, {2, 5}, {7, 4}}) {
    const auto random = [&](at::IntArrayRef shape) {
      return torch::randn(shape, generator, torch::kFloat64).requires_grad_();
    };
    const std::vector<Tensor> x{random({2, 3, height, width}), random({3, 5, 4, 4}), random({5})};
    const Tensor found = transposed_convolution(x[0], x[1], x[2]),
                 expected = at::conv_transpose2d(x[0], x[1], x[2], 2, 1),
                 grad = random({2, 5, 2 * height, 2 * width}).detach();
    EXPECT_TRUE(test::is_near(found, expected, 1e-12));
    const auto a = torch::autograd::grad({found}, x, {grad}), b = torch::autograd::grad({expected}, x, {grad});
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(test::is_near(a[i], b[i], 1e-11)) << i;
  }
}

TEST(DropoutReference, DrawsFromTheGeneratorAlone) {
  const Tensor ones = torch::ones({4, 8, 16, 16});
  std::vector<Tensor> results;
  const int before = at::get_num_threads();
  for (const int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    torch::manual_seed(static_cast<uint64_t>(threads));  // what must not matter
    results.push_back(dropout(ones, 0.5, seeded(6)));
  }
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(results[0], results[1]));
  EXPECT_TRUE(torch::equal(results[0], results[2]));
  EXPECT_FALSE(torch::equal(results[0], dropout(ones, 0.5, seeded(7))));
  EXPECT_NEAR(results[0].mean().item<double>(), 1.0, 0.05);
  EXPECT_TRUE(((results[0] == 0.0) | (results[0] == 2.0)).all().item<bool>());
  const Tensor x = torch::ones({100}).requires_grad_();
  const Tensor y = dropout(x, 0.25, seeded(6));
  y.sum().backward();
  EXPECT_TRUE(torch::equal(x.grad(), y.detach()));
}

TEST(TexNetReference, GivesATextureWithColoursInRange) {
  for (const Upsampling upsample : {Upsampling::transposed, Upsampling::bilinear_conv})
    for (const int size : {16, 64}) {
      TexNetConfig config = small_config();
      config.size = size;
      config.unet.upsample = upsample;
      TexNet net(config);
      const Tensor texture = net->forward(random_input(config, 2), seeded(1));
      EXPECT_EQ(texture.sizes(), (std::vector<int64_t>{2, size, size, 3}));
      EXPECT_TRUE(texture.is_contiguous());
      EXPECT_GE(texture.min().item<double>(), 0.0);
      EXPECT_LE(texture.max().item<double>(), 1.0);
    }
}

TEST(TexNetReference, StacksNormalsAndCamera) {
  const Tensor normals = torch::randn({2, 9, 8, 8}), centre = torch::randn({2, 3}) * 4.0, front = torch::randn({2, 3});
  const TexNetInput input = texnet_input(normals, centre, front);
  ASSERT_EQ(input.camera.sizes(), (std::vector<int64_t>{2, 6, 8, 8}));
  EXPECT_TRUE(torch::equal(input.normals, normals));
  EXPECT_TRUE(torch::equal(input.camera.select(2, 3).select(2, 5).narrow(1, 0, 3), centre / 4.0));
  EXPECT_TRUE(torch::equal(input.camera.select(2, 7).select(2, 0).narrow(1, 3, 3), front));
}

TEST(TexNetReference, CameraCentreFollowsTheRootOnDemand) {
  const Character character = make_test_character();
  const MotionWindow motion(character.skeleton);
  const Tensor dofs = torch::randn({2, character.num_dofs()}), centre = torch::randn({2, 3});
  TexNetConfig config = small_config();
  EXPECT_TRUE(torch::equal(texnet_camera_centre(config, motion, centre, dofs), centre));
  config.camera_centre = CameraCentre::root_relative;
  EXPECT_TRUE(torch::equal(texnet_camera_centre(config, motion, centre, dofs), centre - motion.translation(dofs)));
}

TEST(TexNetReference, ResidualStartsAtTheStaticTexture) {
  TexNetConfig config = small_config();
  config.residual = true;
  config.unet.head_scale = 0.01;
  const Tensor texture = torch::rand({32, 32, 3}, seeded(2));
  TexNet net(config, texture);
  const Tensor found = net->forward(random_input(config, 2), seeded(1));
  EXPECT_LT(largest(found - texture), 0.02);
  EXPECT_TRUE(net->named_buffers().contains("static_texture"));
  // Beyond the range the gradient still arrives.
  TexNet white(config, torch::full({32, 32, 3}, 2.0));
  const Tensor clamped = white->forward(random_input(config, 2), seeded(1));
  EXPECT_TRUE((clamped == 1.0).all().item<bool>());
  clamped.sum().backward();
  EXPECT_GT(largest(white->named_parameters()["unet.up0.bias"].grad()), 1.0);
}

TexNetConfig lit_config() {
  TexNetConfig config = small_config();
  config.residual = true;
  config.lit = true;
  return config;
}
Tensor some_lighting() { return identity_lighting() + 0.1 * torch::randn({3, kShBasis}, seeded(12)); }

TEST(TexNetReference, LitStartsAtTheStaticTextureUnderLight) {
  TexNetConfig config = lit_config();
  config.unet.head_scale = 0.0;
  const Tensor lighting = identity_lighting();
  lighting[0][1] = 0.5;   // red from above: y
  lighting[1][6] = 0.25;  // green: 3 z^2 - 1
  lighting[2][5] = 0.5;   // blue: yz
  TexNet net(config, torch::full({32, 32, 3}, 0.4), lighting);
  Tensor input = random_channels(config, 2);
  input.narrow(1, 6, 3).zero_();  // normals of the newest frame: upwards, but in one column towards (0, 3, 4) / 5
  input.select(1, 7).fill_(1.0);
  input.select(1, 7).select(2, 3).fill_(0.6);
  input.select(1, 8).select(2, 3).fill_(0.8);
  const Tensor found = net->forward(split(input), seeded(1));
  const auto expect = [&](int64_t column, double red, double green, double blue) {
    const Tensor expected = 0.4 * torch::tensor({red, green, blue}).expand({2, 32, 3});
    EXPECT_LT(largest(found.select(2, column) - expected), 1e-6) << column;
  };
  expect(0, 1.5, 0.75, 1.0);
  expect(3, 1.3, 1 + 0.25 * (3 * 0.64 - 1), 1 + 0.5 * 0.48);
  EXPECT_TRUE(torch::equal(net->named_buffers()["lighting"], lighting));
}

TEST(TexNetReference, DetailKeepsTheTexelsOfALargerStaticTexture) {
  TexNetConfig config = lit_config();
  config.detail = 4;
  config.unet.head_scale = 0.0;
  EXPECT_EQ(config.texture_size(), 128);
  const Tensor texture = torch::rand({128, 128, 3}, seeded(2));
  TexNet net(config, texture, identity_lighting());
  Tensor input = random_channels(config, 2);
  input.narrow(1, 6, 3).zero_();
  input.select(1, 7).fill_(1.0);
  EXPECT_LT(largest(net->forward(split(input), seeded(1)) - texture), 1e-6);
  EXPECT_THAT(message_of<Error>([&] {
                TexNet(config, torch::rand({32, 32, 3}), identity_lighting());
              }),
              HasSubstr("static_texture"));
}

TEST(TexNetAgrees, WithItselfInEvaluationWhateverTheBatchAndGenerator) {
  const TexNetConfig config = small_config();
  TexNet net(config);
  const Tensor channels = random_channels(config, 3);
  const TexNetInput input = split(channels);
  for (int step = 0; step < 3; ++step) net->forward(input, seeded(static_cast<uint64_t>(step)));
  net->eval();
  torch::NoGradGuard no_grad;
  const Tensor texture = net->forward(input);
  EXPECT_TRUE(torch::equal(texture, net->forward(input, seeded(77))));
  EXPECT_LT(largest(texture.narrow(0, 1, 1) - net->forward(split(channels.narrow(0, 1, 1)))), 1e-5);
  const Tensor mean = net->named_buffers()["unet.down_norm1.running_mean"];
  EXPECT_GT(largest(mean), 0.0) << "training moves the running statistics";
}

TEST(TexNetAgrees, WithItselfFromTheSameGenerator) {
  const TexNetConfig config = small_config();
  TexNet first(config), second(config);
  const TexNetInput input = random_input(config, 2);
  torch::manual_seed(1);
  const Tensor a = first->forward(input, seeded(5));
  torch::manual_seed(2);
  EXPECT_TRUE(torch::equal(a, second->forward(input, seeded(5))));
  EXPECT_FALSE(torch::equal(a, second->forward(input, seeded(6))));
}

TEST(TexNetAgrees, InTheKernelsForInferenceWithTheLayersOfTraining) {
  for (const Upsampling upsample : {Upsampling::transposed, Upsampling::bilinear_conv})
    for (const bool lit : {false, true}) {
      TexNetConfig config = lit ? lit_config() : small_config();
      config.unet.upsample = upsample;
      TexNet net = lit ? TexNet(config, torch::rand({32, 32, 3}, seeded(2)), some_lighting()) : TexNet(config);
      const TexNetInput input = random_input(config, 2);
      for (uint64_t step = 0; step < 3; ++step) net->forward(input, seeded(step));  // moves the running statistics
      net->eval();
      const Tensor expected = net->forward(input).detach();
      torch::NoGradGuard no_grad;
      EXPECT_LT(largest(net->forward(input) - expected), 1e-5) << lit;
    }
}

TEST(TexNetAgrees, AsATraceOnBatchesItHasNotSeen) {
  const TexNetConfig config = lit_config();
  TexNet net(config, torch::rand({32, 32, 3}, seeded(2)), some_lighting());
  net->eval();
  for (Tensor parameter : net->parameters()) parameter.set_requires_grad(false);
  const auto traced = torch::jit::tracer::trace(
      {random_channels(config, 2)},
      [&](torch::jit::Stack stack) -> torch::jit::Stack { return {net->forward(split(stack[0].toTensor()))}; },
      [](const torch::autograd::Variable&) { return ""; });
  torch::jit::GraphExecutor executor(traced.first->graph, "texnet");
  for (const int64_t batch : {1, 3}) {
    const Tensor input = random_channels(config, batch);
    torch::jit::Stack stack{input};
    executor.run(stack);
    EXPECT_LT(largest(stack[0].toTensor() - net->forward(split(input))), 1e-5) << "batch " << batch;
  }
}

TEST(TexNetRecovers, ATextureThatFollowsTheNormals) {
  TexNetConfig config = small_config();
  config.unet.dropout = 0.0;
  TexNet net(config);
  // Smooth maps, as normals are; the colours are a shading of the newest ones.
  const Tensor coarse = torch::randn({4, config.num_inputs(), 4, 4}, seeded(4));
  const Tensor input = at::upsample_bilinear2d(coarse, {config.size, config.size}, false);
  const Tensor target = (0.5 + 0.3 * input.narrow(1, 6, 3).tanh()).permute({0, 2, 3, 1});
  torch::optim::Adam adam(net->parameters(), torch::optim::AdamOptions(5e-3));
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 100; ++step) {
    adam.zero_grad();
    const Tensor loss = (net->forward(split(input)) - target).abs().mean();
    loss.backward();
    adam.step();
    last = loss.item<double>();
    if (step == 0) first = last;
  }
  EXPECT_LT(last, 0.5 * first);
}

TEST(TexNetRecovers, ItsStateFromAnArchive) {
  const TexNetConfig config = lit_config();
  TexNet net(config, torch::rand({32, 32, 3}, seeded(2)), some_lighting());
  const TexNetInput input = random_input(config, 2);
  net->forward(input, seeded(1));
  net->eval();
  std::stringstream file;
  torch::serialize::OutputArchive out;
  net->save(out);
  out.save_to(file);
  TexNet other(config, torch::zeros({32, 32, 3}), identity_lighting(), seeded(9));
  torch::serialize::InputArchive in;
  in.load_from(file);
  other->load(in);
  other->eval();
  EXPECT_TRUE(torch::equal(net->forward(input), other->forward(input)));
}

TexNetConfig read(const std::string& text) {
  const ConfigDocument document = ConfigDocument::parse(text, "texnet.yaml");
  const ConfigReader root = document.root();
  const TexNetConfig config = read_options<TexNetConfig>(root);
  root.finish();
  config.check();
  return config;
}

TEST(TexNetConfigReference, ReadsDefaultsAndChanges) {
  const TexNetConfig paper = read("{}");
  EXPECT_EQ(paper.size, 1024);
  EXPECT_EQ(paper.num_levels(), 10);
  EXPECT_EQ(paper.num_inputs(), 15);
  EXPECT_EQ(paper.unet.norm_epsilon, 1e-3);
  EXPECT_EQ(paper.unet.leaky_slope, 0.3);
  EXPECT_FALSE(paper.residual || paper.lit || paper.surface_normals);
  EXPECT_EQ(read("size: 256").num_levels(), 8);
  const TexNetConfig changed = read(
      "size: 512\nlevels: 5\nwidth: 0.5\nupsample: bilinear_conv\ncamera_centre: root_relative\nresidual: true\n"
      "lit: true\nsurface_normals: true");
  EXPECT_EQ(changed.num_levels(), 5);
  EXPECT_EQ(changed.unet.channels(0), 8);
  const UNetConfig pix2pix = read("first_channels: 64\nleaky_slope: 0.2").unet;
  EXPECT_EQ(pix2pix.channels(0), 64);
  EXPECT_EQ(pix2pix.channels(3), 512);
  EXPECT_EQ(pix2pix.channels(9), 512);
  EXPECT_EQ(pix2pix.leaky_slope, 0.2);
  EXPECT_EQ(changed.unet.upsample, Upsampling::bilinear_conv);
  EXPECT_EQ(changed.camera_centre, CameraCentre::root_relative);
  EXPECT_TRUE(changed.residual);
  EXPECT_TRUE(changed.lit);
  EXPECT_TRUE(changed.surface_normals);
  EXPECT_LT(changed.unet.head_scale, 1.0);
}

TEST(TexNetConfigRejects, MistakesWithFileAndKey) {
  const auto message = [](const std::string& text) { return message_of<Error>([&] { read(text); }); };
  EXPECT_THAT(message("size: 500"), HasSubstr("power of two"));
  EXPECT_THAT(message("size: 4"), HasSubstr("size"));
  EXPECT_THAT(message("size: 256\nlevels: 9"), HasSubstr("levels"));
  EXPECT_THAT(message("upsample: nearest"), HasSubstr("upsample"));
  EXPECT_THAT(message("camera_center: absolute"), HasSubstr("camera_centre"));
  EXPECT_THAT(message("past_frames: -2"), HasSubstr("past_frames"));
  EXPECT_THAT(message("lit: true"), HasSubstr("residual: true"));
  EXPECT_THAT(message("detail: 2"), HasSubstr("1 without `residual`"));
  EXPECT_THAT(message("residual: true\ndetail: 3"), HasSubstr("power of two"));
  EXPECT_THAT(message("residual: true\nsize: 1024\ndetail: 8"), HasSubstr("at most 4096"));
  TexNetConfig config;
  config.size = 300;
  config.past_frames = -1;
  EXPECT_THAT(message_of<Error>([&] { config.check(); }), HasSubstr("past_frames"));
}

TEST(TexNetRejects, WhatItCannotCompute) {
  const TexNetConfig config = small_config();
  TexNet net(config);
  EXPECT_THAT(message_of<Error>([&] {
                net->forward(split(torch::zeros({2, 15, 16, 16})), seeded(1));
              }),
              HasSubstr("input"));
  EXPECT_THAT(message_of<Error>([&] { net->forward(random_input(config, 1), seeded(1)); }), HasSubstr("larger batch"));
  EXPECT_THAT(message_of<Error>([&] { net->forward(random_input(config, 2)); }), HasSubstr("generator"));
  TexNetConfig residual = config;
  residual.residual = true;
  EXPECT_THAT(message_of<Error>([&] { TexNet missing(residual); }), HasSubstr("static_texture"));
  EXPECT_THAT(message_of<Error>([&] { TexNet dark(lit_config(), torch::zeros({32, 32, 3})); }), HasSubstr("lighting"));
  UNetConfig unet;
  unet.levels = 3;
  EXPECT_THAT(message_of<Error>([&] {
                UNet(1, 1, unet)->forward(torch::zeros({2, 1, 12, 16}), seeded(1));
              }),
              HasSubstr("multiples of 8"));
  EXPECT_EQ(net->forward(random_input(config, 0), seeded(1)).sizes(), (std::vector<int64_t>{0, 32, 32, 3}));
}

}  // namespace
}  // namespace doppel::tex_net_test
