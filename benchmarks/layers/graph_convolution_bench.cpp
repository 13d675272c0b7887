// Structure-aware graph convolution, forward + backward, against what one writes without it: einsum for the kernels and
// torch's sparse product, COO or CSR, for the neighbourhood sum. Equal results are checked before anything is timed.
//
//   graph_convolution_bench [threads] [turns]
//
// The graph is a torus of triangles with 5,514 nodes, 37 neighbours within 3 rings, and some disorder in the numbering,
// as on scanned meshes.

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <random>

#include "doppel/geometry/topology.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "support/ratio.h"

namespace {

using doppel::RingWeights;
using torch::Tensor;

constexpr int kNodes = 5514;
constexpr int kRings = 4;  // weights 4 - hops: three rings count

/// A torus of triangles, 6 neighbours each; nodes shuffled within stretches of 64.
doppel::MeshTopology make_graph() {
  std::vector<int> name(kNodes);
  std::iota(name.begin(), name.end(), 0);
  std::mt19937 generator(1);
  for (int start = 0; start < kNodes; start += 64)
    for (int i = std::min(start + 63, kNodes - 1); i > start; --i)
      std::swap(name[i], name[start + static_cast<int>(generator() % (i - start + 1))]);
  // A helix around the torus, 74 nodes per turn.
  const auto at = [&](int i) { return name[i % kNodes]; };
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i < kNodes; ++i)
    for (const int step : {1, 74, 75}) edges.push_back({std::min(at(i), at(i + step)), std::max(at(i), at(i + step))});
  return doppel::MeshTopology(kNodes, edges);
}

struct Problem {
  RingWeights ring;
  Tensor features, kernels, bias, grad;  // features and grad [K,B,H]
  Tensor coo, csr, csr_transposed;
};

Tensor coo_of(const RingWeights& ring) {
  const Tensor kept = (ring.weights > 0).flatten();
  const Tensor rows = torch::arange(ring.num_nodes).unsqueeze(1).expand_as(ring.neighbours).flatten();
  const Tensor index = torch::stack({rows.masked_select(kept), ring.neighbours.flatten().masked_select(kept)});
  return torch::sparse_coo_tensor(index, ring.weights_float.flatten().masked_select(kept),
                                  {ring.num_nodes, ring.num_nodes})
      .coalesce();
}

Problem make_problem(int64_t batch, int64_t inputs, int64_t outputs) {
  Problem p;
  p.ring = RingWeights::from_topology(make_graph(), kRings);
  torch::manual_seed(0);
  p.features = torch::randn({p.ring.num_nodes, batch, inputs}).requires_grad_();
  p.kernels = torch::randn({p.ring.num_nodes, inputs, outputs}).mul_(0.25).requires_grad_();
  p.bias = torch::randn({p.ring.num_nodes, outputs}).requires_grad_();
  p.grad = torch::randn({p.ring.num_nodes, batch, outputs});
  p.coo = coo_of(p.ring);
  p.csr = p.coo.to_sparse_csr();
  p.csr_transposed = p.coo.t().coalesce().to_sparse_csr();
  return p;
}

/// A CSR product whose backward multiplies with the prepared transpose, the fair opponent.
struct CsrProduct : torch::autograd::Function<CsrProduct> {
  static Tensor forward(torch::autograd::AutogradContext* context, const Tensor& z, const Problem* p) {
    context->saved_data["p"] = reinterpret_cast<int64_t>(p);
    return torch::matmul(p->csr, z);
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grad) {
    const auto* p = reinterpret_cast<const Problem*>(context->saved_data["p"].toInt());
    return {torch::matmul(p->csr_transposed, grad[0]), Tensor()};
  }
};

Tensor einsum_sparse(const Problem& p, bool csr) {
  const Tensor z = torch::einsum("kbh,kho->kbo", {p.features, p.kernels});
  const Tensor mixed = csr ? CsrProduct::apply(z.flatten(1), &p) : torch::mm(p.coo, z.flatten(1));
  return mixed.view_as(z) + p.bias.unsqueeze(1);
}

Tensor ours(const Problem& p) { return doppel::graph_convolution_node_major(p.features, p.kernels, p.bias, p.ring); }

std::vector<Tensor> both_ways(const Problem& p, const Tensor& output) {
  auto gradients = torch::autograd::grad({output}, {p.features, p.kernels, p.bias}, {p.grad});
  gradients.push_back(output.detach());
  return gradients;
}

void require_equal(const Problem& p) {
  const auto expected = both_ways(p, einsum_sparse(p, false)), csr = both_ways(p, einsum_sparse(p, true)),
             found = both_ways(p, ours(p));
  for (std::size_t i = 0; i < expected.size(); ++i)
    if (!torch::allclose(found[i], expected[i], 1e-4, 1e-4) || !torch::allclose(csr[i], expected[i], 1e-4, 1e-4)) {
      std::fprintf(stderr, "result %zu differs; nothing is timed\n", i);
      std::exit(1);
    }
}

void run(int64_t batch, int64_t inputs, int64_t outputs, int turns) {
  const Problem p = make_problem(batch, inputs, outputs);
  require_equal(p);
  doppel::bench::RatioOptions options;
  options.turns = turns;
  char title[160];
  std::snprintf(title, sizeof(title), "K %lld, %.1f neighbours, %lldx%lld, batch %lld, %d threads",
                static_cast<long long>(p.ring.num_nodes), static_cast<double>(p.ring.num_entries) / p.ring.num_nodes,
                static_cast<long long>(inputs), static_cast<long long>(outputs), static_cast<long long>(batch),
                at::get_num_threads());
  doppel::bench::compare(std::string("forward + backward: ") + title,
                         {{"einsum + sparse COO", [&] { both_ways(p, einsum_sparse(p, false)); }},
                          {"einsum + sparse CSR", [&] { both_ways(p, einsum_sparse(p, true)); }},
                          {"doppel, node-major", [&] { both_ways(p, ours(p)); }}},
                         options);
  torch::NoGradGuard no_grad;
  doppel::bench::compare(std::string("forward: ") + title,
                         {{"einsum + sparse COO", [&] { einsum_sparse(p, false); }},
                          {"einsum + sparse CSR", [&] { einsum_sparse(p, true); }},
                          {"doppel, node-major", [&] { ours(p); }}},
                         options);
  const double sums = 2e-6 * p.ring.num_entries * batch * outputs,
               products = 2e-6 * p.ring.num_nodes * batch * inputs * outputs;
  std::printf(
      "  work: %.0f MFLOP of sums and %.0f of products forward, 2 and 3 times that with backward; kernels %.1f MB\n\n",
      sums, products, 4e-6 * p.kernels.numel());
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const int turns = argc > 2 ? std::atoi(argv[2]) : 25;
  run(8, 16, 16, turns);
  run(1, 16, 16, turns);
  return 0;
}
