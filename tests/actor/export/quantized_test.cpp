// Quantized weights: their arithmetic, their choice, and files as a host reads them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "actor/export/dressed_actor.h"
#include "doppel/actor/export/actor_weights.h"
#include "doppel/actor/export/quantized_export.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::quantized_test {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

TEST(QuantizedWeightReference, EightBitsAreMultiplesOfTheScaleOfTheirChannel) {
  // Largest 2 * 127, 0 and 0.5 * 127: the scales are 2, 0 and 0.5.
  const Tensor weight = torch::tensor({{254.0f, -101.0f, 0.9f}, {0.0f, 0.0f, 0.0f}, {-63.5f, 0.7f, 20.2f}});
  const QuantizedWeight found = quantized_weight("w", weight, {0}, 8);
  EXPECT_TRUE(found.scale.equal(torch::tensor({2.0f, 0.0f, 0.5f}).view({3, 1})));
  EXPECT_EQ(found.values.scalar_type(), torch::kInt8);
  // -101 / 2 lies between two integers: the even one.
  EXPECT_TRUE(found.values.equal(torch::tensor({{127, -50, 0}, {0, 0, 0}, {-127, 1, 40}}).to(torch::kInt8)));
  EXPECT_TRUE(dequantized(found.values, found.scale)
                  .equal(torch::tensor({{254.0f, -100.0f, 0.0f}, {0.0f, 0.0f, 0.0f}, {-63.5f, 0.5f, 20.0f}})));
}

TEST(QuantizedWeightReference, NoWeightIsOffByMoreThanHalfAScale) {
  const Tensor weight = torch::randn({5, 7, 4}, at::detail::createCPUGenerator(1));
  const QuantizedWeight found = quantized_weight("w", weight, {0, 2}, 8);  // nodes and outputs
  EXPECT_EQ(found.scale.sizes(), torch::IntArrayRef({5, 1, 4}));
  EXPECT_TRUE(found.scale.allclose(weight.abs().amax({1}, true) / 127));
  const Tensor off = (dequantized(found.values, found.scale) - weight).abs();
  EXPECT_TRUE((off <= found.scale * (0.5 + 127 * 2e-7)).all().item<bool>());  // + rounding of float32
}

TEST(QuantizedWeightReference, SixteenBitsKeepElevenBits) {
  const Tensor weight = torch::randn({1000, 3}, at::detail::createCPUGenerator(2));
  const QuantizedWeight found = quantized_weight("w", weight, {0}, 16);
  EXPECT_FALSE(found.scale.defined());
  const Tensor off = (dequantized(found.values, found.scale) - weight).abs();
  // Below 2^-14, half numbers are multiples of 2^-24.
  EXPECT_TRUE((off <= (weight.abs() * std::pow(2.0, -11)).clamp_min(std::pow(2.0, -25))).all().item<bool>());
  const Tensor exact = torch::tensor({1.0f + 1.0f / 1024, 2047.0f, -65504.0f});
  EXPECT_TRUE(dequantized(quantized_weight("w", exact, {0}, 16).values, {}).equal(exact));
}

TEST(QuantizedWeightErrors, NameTheWeightAndWhatIsAllowed) {
  const Tensor large = torch::tensor({{1.0f, 1e5f}});
  EXPECT_THAT(support::message_of([&] { quantized_weight("net.w", large, {0}, 16); }),
              ::testing::AllOf(HasSubstr("net.w"), HasSubstr("1e+05"), HasSubstr("65504"), HasSubstr("--quantize 8")));
  EXPECT_NO_THROW(quantized_weight("net.w", large, {0}, 8));
  const Tensor damaged = torch::full({1, 2}, std::numeric_limits<float>::quiet_NaN());
  for (const int bits : {8, 16})
    EXPECT_THAT(support::message_of([&] { quantized_weight("net.w", damaged, {0}, bits); }), HasSubstr("nan"));
  EXPECT_THROW(quantized_weight("net.w", large, {0}, 4), UsageError);
}

ScriptModules modules_of(TrainedActor& actor) {
  return {{"egnet", actor.egnet.get()},
          {"surface", actor.surface.get()},
          {"deltanet", actor.deltanet.get()},
          {"texnet", actor.texnet.get()},
          {"surface_gaussians", actor.gaussians.get()}};
}

bool ends_with_weight(const std::string& name) { return name.ends_with(".kernels") || name.ends_with(".weight"); }

TEST(QuantizedWeightsBehave, OnlyKernelsOfConvolutionsAreChosen) {
  TrainedActor actor = support::dressed_actor();
  const QuantizedWeights quantized(modules_of(actor), 8);
  std::size_t large = 0;
  for (const auto& [prefix, network] : modules_of(actor)) {
    for (const auto& entry : network->named_parameters()) {
      const std::string name = prefix + "." + entry.key();
      const bool norm = name.find("norm") != std::string::npos;
      const QuantizedWeight* found = quantized.find(entry.value());
      EXPECT_EQ(found != nullptr, ends_with_weight(name) && !norm) << name;
      if (!found) continue;
      EXPECT_EQ(found->name, name);
      ++large;
    }
    for (const auto& entry : network->named_buffers()) EXPECT_EQ(quantized.find(entry.value()), nullptr) << entry.key();
  }
  EXPECT_EQ(large, quantized.all().size());
  EXPECT_EQ(quantized.find(torch::ones({3})), nullptr);
  EXPECT_EQ(QuantizedWeights().find(torch::ones({3})), nullptr);
}

std::int64_t bytes_of(const std::filesystem::path& path) {
  return static_cast<std::int64_t>(std::filesystem::file_size(path));
}

/// The float32 tensors of a file by the rule of docs/export.md, written as a host would write it.
std::map<std::string, Tensor> read_as_a_host(const std::filesystem::path& path) {
  std::map<std::string, Tensor> tensors;
  for (const auto& [name, tensor] : read_safetensors(path)) tensors[name] = tensor;
  for (auto& [name, tensor] : tensors) {
    if (tensor.scalar_type() == torch::kInt8) tensor = tensor.to(torch::kFloat32) * tensors.at(name + ".scale");
    if (tensor.scalar_type() == torch::kFloat16) tensor = tensor.to(torch::kFloat32);
  }
  return tensors;
}

ModelSamples two_poses(TrainedActor& actor) {
  const Tensor windows = random_windows(support::description_of(actor), 2, 31), cameras = random_projections(2, 32);
  return {2, [&actor, windows, cameras](std::int64_t i) {
            const Tensor window = windows.narrow(0, i, 1), camera = cameras.narrow(0, i, 1);
            const Tensor vertices = actor.fine(window);
            return std::vector<ModelOutput>{
                {"vertices", ModelOutput::Kind::points, vertices},
                {"texture", ModelOutput::Kind::colours, actor.texture(window, camera, vertices)}};
          }};
}

class QuantizedFileAgrees : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Bits, QuantizedFileAgrees, ::testing::Values(8, 16));

TEST_P(QuantizedFileAgrees, WithTheStatedSizeAndErrorAsAHostReadsIt) {
  const torch::NoGradGuard no_grad;
  const support::TemporaryFolder folder;
  TrainedActor actor = support::dressed_actor();
  const ActorDescription description = support::description_of(actor);
  const ScriptModules modules = modules_of(actor);
  const QuantizedWeights quantized(modules, GetParam());
  write_actor_weights(folder / "whole.safetensors", actor.character, description, modules);
  write_actor_weights(folder / "small.safetensors", actor.character, description, modules, quantized);
  const ModelSamples samples = two_poses(actor);
  const std::vector<ModelOutput> own = samples.outputs(1);
  const QuantizationReport report =
      compare_quantized(quantized, read_safetensors(folder / "small.safetensors"), samples);
  EXPECT_TRUE(samples.outputs(1)[0].values.equal(own[0].values)) << "the networks have their own weights again";

  std::int64_t weights = 0, scales = 0;
  for (const QuantizedWeight& weight : quantized.all()) {
    weights += weight.parameter.numel();
    scales += weight.scale.defined() ? weight.scale.numel() : 0;
  }
  EXPECT_EQ(report.float_bytes, 4 * weights);
  EXPECT_EQ(report.bytes, GetParam() / 8 * weights + 4 * scales);
  EXPECT_NEAR(bytes_of(folder / "whole.safetensors") - bytes_of(folder / "small.safetensors"),
              report.float_bytes - report.bytes, 150.0 * static_cast<double>(quantized.all().size()));  // the header

  // A second actor gets the tensors of the file as they are for a host. Its error is the stated one.
  TrainedActor host = support::dressed_actor();
  const auto tensors = read_as_a_host(folder / "small.safetensors");
  for (const auto& [prefix, network] : modules_of(host)) {
    for (auto& entry : network->named_parameters()) entry.value().copy_(tensors.at(prefix + "." + entry.key()));
    for (auto& entry : network->named_buffers()) entry.value().copy_(tensors.at(prefix + "." + entry.key()));
  }
  const ModelSamples host_samples = two_poses(host);
  double largest = 0.0, colour = 0.0;
  for (int i = 0; i < 2; ++i) {
    const auto found = host_samples.outputs(i), wanted = samples.outputs(i);
    largest = std::max(largest, (found[0].values - wanted[0].values).norm(2, {-1}, false).max().item<double>());
    colour = std::max(colour, (found[1].values - wanted[1].values).abs().max().item<double>());
  }
  ASSERT_EQ(report.errors.size(), 2U);
  EXPECT_NEAR(report.errors[0].largest, 1000 * largest, 0.02);  // kernels sum in another order: 1e-5 m
  EXPECT_NEAR(report.errors[1].largest, 255 * colour, 0.26);    // kTraceColourTolerance
  EXPECT_GT(report.errors[0].largest, report.errors[0].mean);
  EXPECT_GT(report.errors[0].mean, 0.0);

  const auto about = nlohmann::json::parse(read_file(folder / "small.json"));
  EXPECT_EQ(about["quantized"]["bits"], GetParam());
  EXPECT_FALSE(nlohmann::json::parse(read_file(folder / "whole.json")).contains("quantized"));
}

TEST(QuantizedFileRejects, WeightsThatDoNotFitAndNumbersThatAreNotFinite) {
  const torch::NoGradGuard no_grad;
  TrainedActor actor = support::dressed_actor();
  const QuantizedWeights quantized({{"egnet", actor.egnet.get()}}, 8);
  const QuantizedWeight& first = quantized.all().front();
  const ModelSamples samples = two_poses(actor);
  const auto message = [&](const NamedWeights& file) {
    return support::message_of([&] { compare_quantized(quantized, file, samples); });
  };
  EXPECT_THAT(message({}), HasSubstr("holds no quantized weight"));
  EXPECT_THAT(message({{first.name, first.values}}), HasSubstr(first.name + ".scale"));
  EXPECT_THAT(message({{first.name, first.values.flatten(0, 1)}, {first.scale_name(), torch::ones({1, 1})}}),
              HasSubstr("the network's is"));
  const Tensor infinite = torch::full_like(first.scale, std::numeric_limits<float>::infinity());
  EXPECT_THAT(message({{first.name, first.values}, {first.scale_name(), infinite}}), HasSubstr("not finite"));
}

}  // namespace
}  // namespace doppel::quantized_test
