// One EGNet training step (features, forward, backward, Adam) and its parts, at the size of the public example: 852
// nodes, and the network in plain tensor operations beside it.
//
//   egnet_bench [threads]        the built-in torus of 852 nodes; features are random

#include <ATen/Parallel.h>
#include <torch/optim/adam.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdio>
#include <cstdlib>

#include "doppel/geometry/topology.h"
#include "doppel/nets/sagcn.h"
#include "support/ratio.h"

namespace {

using torch::Tensor;

constexpr int kNodes = 852;

/// A helix of triangles around a torus, 6 neighbours each.
doppel::RingWeights make_ring() {
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i < kNodes; ++i)
    for (const int step : {1, 29, 30}) {
      const int other = (i + step) % kNodes;
      edges.push_back({std::min(i, other), std::max(i, other)});
    }
  return doppel::RingWeights::from_topology(doppel::MeshTopology(kNodes, edges), 3);
}

void run(int64_t batch) {
  doppel::Sagcn net(make_ring(), 18, 6, doppel::SagcnConfig{});
  torch::manual_seed(0);
  const Tensor features = torch::randn({batch, kNodes, 18}), grad = torch::randn({batch, kNodes, 6});
  torch::optim::Adam adam(net->parameters(), torch::optim::AdamOptions(1e-4));
  const auto step = [&](bool reference) {
    net->zero_grad(false);
    (reference ? net->forward_reference(features) : net->forward(features)).backward(grad);
  };
  char title[100];
  std::snprintf(title, sizeof(title), "SAGCN of EGNet, K %d, batch %lld, %d threads: ", kNodes,
                static_cast<long long>(batch), at::get_num_threads());
  doppel::bench::compare(std::string(title) + "forward + backward",
                         {{"plain tensor operations", [&] { step(true); }}, {"doppel", [&] { step(false); }}});
  {
    torch::NoGradGuard no_grad;
    net->eval();
    doppel::bench::compare(std::string(title) + "forward, eval",
                           {{"plain tensor operations", [&] { net->forward_reference(features); }},
                            {"doppel", [&] { net->forward(features); }}});
    net->train();
  }
  step(false);
  doppel::bench::compare("torch::optim::Adam on its parameters", {{"step", [&] { adam.step(); }}});
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  for (const int64_t batch : {8, 16}) run(batch);
  return 0;
}
