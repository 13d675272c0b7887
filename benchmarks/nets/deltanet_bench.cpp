// DeltaNet at the size of a body (5,514 vertices): one forward pass at batch 1 against reading its weights once, the
// least any implementation can do, and what a training step costs.
//
//   deltanet_bench [threads] [file.character]        without a file a tube of 5,514 vertices

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdio>
#include <cstdlib>
#include <numeric>

#include "doppel/core/process.h"
#include "doppel/nets/delta_net.h"
#include "support/ratio.h"
#include "support/test_character.h"

namespace {

using doppel::DeltaNet;
using torch::Tensor;

typedef float Lanes __attribute__((vector_size(32), aligned(4), may_alias));

/// Eight sums side by side: enough loads in flight to keep the memory busy.
float sum_of(const float* numbers, int64_t count) {
  constexpr int64_t kLanes = 8, kChains = 8;
  Lanes sums[kChains] = {};
  int64_t i = 0;
  for (; i + kLanes * kChains <= count; i += kLanes * kChains)
    for (int64_t c = 0; c < kChains; ++c) sums[c] += *reinterpret_cast<const Lanes*>(numbers + i + c * kLanes);
  float total = 0.0f;
  for (; i < count; ++i) total += numbers[i];
  for (const Lanes& chain : sums)
    for (int64_t lane = 0; lane < kLanes; ++lane) total += chain[lane];
  return total;
}

/// Adds up every weight with all threads.
float stream_weights(const std::vector<Tensor>& weights) {
  std::vector<float> partial(static_cast<size_t>(at::get_num_threads()), 0.0f);
  at::parallel_for(0, static_cast<int64_t>(partial.size()), 1, [&](int64_t begin, int64_t end) {
    const auto parts = static_cast<int64_t>(partial.size());
    for (int64_t part = begin; part < end; ++part)
      for (const Tensor& weight : weights) {
        const int64_t count = weight.numel(), from = count * part / parts, to = count * (part + 1) / parts;
        partial[static_cast<size_t>(part)] += sum_of(weight.data_ptr<float>() + from, to - from);
      }
  });
  return std::accumulate(partial.begin(), partial.end(), 0.0f);
}

Tensor windows_of(const doppel::Character& character, int64_t batch) {
  const Tensor rest = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat32);
  return rest + 0.1 * torch::randn({batch, 3, character.num_dofs()}, at::detail::createCPUGenerator(1));
}

/// The network of a body, with the same weights in each.
DeltaNet evaluated_net(const doppel::Character& character, doppel::DenseBlock dense) {
  doppel::DeltaNetConfig config;
  config.sagcn.dense = dense;
  DeltaNet net(character, config);
  net->eval();
  return net;
}

DeltaNet frozen_net(const doppel::Character& character, doppel::DenseBlock dense, doppel::WeightFormat format) {
  DeltaNet net = evaluated_net(character, dense);
  doppel::freeze_graph_networks(*net, format);
  return net;
}

void forward_at_batch_one(const doppel::Character& character, doppel::DenseBlock dense) {
  DeltaNet net = evaluated_net(character, dense);
  DeltaNet exact = frozen_net(character, dense, doppel::WeightFormat::float32);
  DeltaNet rounded = frozen_net(character, dense, doppel::WeightFormat::bfloat16);
  torch::NoGradGuard no_grad;
  const Tensor window = windows_of(character, 1);
  const std::vector<Tensor> weights = net->parameters();
  double bytes = 0.0;
  for (const Tensor& weight : weights) bytes += 4.0 * weight.numel();
  const Tensor expected = net->forward(window);
  const auto error = [&](DeltaNet& of) {
    return ((of->forward(window) - expected).abs().max() / expected.abs().max()).item<double>();
  };
  std::printf("largest difference over the largest output: float32 %.1e, bfloat16 %.1e\n", error(exact),
              error(rounded));
  float sink = 0.0f;
  char title[160];
  std::snprintf(title, sizeof(title), "DeltaNet forward, N %d, batch 1, %d threads, dense block %s, weights %.1f MB",
                character.num_vertices(), at::get_num_threads(),
                dense == doppel::DenseBlock::none ? "none" : "broadcast", bytes / 1e6);
  const auto times =
      doppel::bench::compare(title, {{"posing the template", [&] { net->network_input(window); }},
                                     {"all, layer by layer", [&] { net->forward(window); }},
                                     {"all, float32", [&] { exact->forward(window); }},
                                     {"all, bfloat16", [&] { rounded->forward(window); }},
                                     {"reading the weights once", [&] { sink += stream_weights(weights); }}});
  std::printf("  weights at %.1f GB/s%s\n\n", bytes / times.back().median_ms / 1e6, sink == 1.0f ? "!" : "");
}

void training_step(const doppel::Character& character, int64_t batch) {
  DeltaNet net(character, doppel::DeltaNetConfig());
  const Tensor window = windows_of(character, batch);
  const Tensor grad = torch::randn({batch, character.num_vertices(), 3}, at::detail::createCPUGenerator(2));
  char title[160];
  std::snprintf(title, sizeof(title), "DeltaNet training, N %d, batch %lld, %d threads", character.num_vertices(),
                static_cast<long long>(batch), at::get_num_threads());
  doppel::bench::RatioOptions options;
  options.turns = 11;
  const std::vector<Tensor> parameters = net->parameters();
  doppel::bench::compare(
      title,
      {{"forward", [&] { net->forward(window); }},
       {"forward + backward", [&] { torch::autograd::grad({net->forward(window)}, parameters, {grad}); }},
       {"reading the weights once", [&] { stream_weights(parameters); }}},
      options);
}

}  // namespace

int main(int argc, char** argv) {
  doppel::setup_process();
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const doppel::Character character =
      argc > 2 ? doppel::load_character(argv[2]) : doppel::make_test_character(20, 53, 104);
  forward_at_batch_one(character, doppel::DenseBlock::broadcast);
  forward_at_batch_one(character, doppel::DenseBlock::none);
  for (const int64_t batch : {1, 4, 8}) training_step(character, batch);
  return 0;
}
