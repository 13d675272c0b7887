/// Embedded deformation against its two eager tensor forms: 500 nodes, 6 per vertex, gradients to A and T, outputs and
/// gradients checked equal first.
///   embedded_deformation_bench [threads = 2]

#include <cstdio>
#include <cstdlib>

#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "layers/body.h"
#include "support/ratio.h"

namespace doppel::bench {
namespace {

using torch::Tensor;

Tensor gather_form(const Tensor& A, const Tensor& T, const Tensor& rest, const Tensor& nodes, const Tensor& items,
                   const Tensor& weights) {
  const int64_t B = A.size(0), N = items.size(0), P = items.size(1);
  const Tensor flat = items.flatten();
  const Tensor rotation = euler_to_matrix(A).index_select(1, flat).view({B, N, P, 3, 3});
  const Tensor g = nodes.index_select(0, flat).view({N, P, 3});
  const Tensor offset = (rest.unsqueeze(1) - g).unsqueeze(-1);
  const Tensor moved = torch::matmul(rotation, offset).squeeze(-1) + g + T.index_select(1, flat).view({B, N, P, 3});
  return (moved * weights.unsqueeze(-1)).sum(2);
}

Tensor dense_form(const Tensor& A, const Tensor& T, const Tensor& rest, const Tensor& nodes, const Tensor& matrix) {
  const Tensor rotation = euler_to_matrix(A);
  const Tensor translation = nodes + T - torch::matmul(rotation, nodes.unsqueeze(-1)).squeeze(-1);
  const Tensor blended = torch::matmul(matrix, torch::cat({rotation.flatten(2), translation}, -1));
  return torch::matmul(blended.narrow(-1, 0, 9).view({A.size(0), -1, 3, 3}), rest.unsqueeze(-1)).squeeze(-1) +
         blended.narrow(-1, 9, 3);
}

void run(const Body& body, int64_t batch) {
  EmbeddedDeformation layer(DeformationGraph(body.vertices, body.nodes, body.vertex_nodes, body.node_weights));
  const SparseRows& rows = layer->graph().weights;
  const Tensor items = rows.padded_items, weights = rows.padded_weights.to(torch::kFloat32);
  const Tensor matrix = dense_matrix(items, weights, 500);
  const Tensor rest = points_tensor(body.vertices), nodes = points_tensor(body.nodes);
  torch::manual_seed(0);
  const Tensor A = (0.3 * torch::randn({batch, 500, 3})).requires_grad_(),
               T = (0.1 * torch::randn({batch, 500, 3})).requires_grad_();
  const Tensor probe = torch::randn({batch, items.size(0), 3});
  const auto gather = [&] { return gather_form(A, T, rest, nodes, items, weights); };
  const auto dense = [&] { return dense_form(A, T, rest, nodes, matrix); };
  const auto kernel = [&] { return layer->forward(A, T); };
  const auto gradients = [&](const Tensor& output) { return torch::autograd::grad({output}, {A, T}, {probe}); };

  const auto expected = gradients(gather()), found = gradients(kernel());
  std::printf("batch %ld: outputs differ by %.1e (gather) %.1e (dense); gradients to A %.1e, T %.1e\n",
              static_cast<long>(batch), difference(kernel(), gather()), difference(kernel(), dense()),
              difference(found[0], expected[0]), difference(found[1], expected[1]));
  compare("  forward", {{"gather",
                         [&] {
                           torch::NoGradGuard g;
                           gather();
                         }},
                        {"dense",
                         [&] {
                           torch::NoGradGuard g;
                           dense();
                         }},
                        {"doppel", [&] {
                           torch::NoGradGuard g;
                           kernel();
                         }}});
  compare("  forward + backward", {{"gather", [&] { gradients(gather()); }},
                                   {"dense", [&] { gradients(dense()); }},
                                   {"doppel", [&] { gradients(kernel()); }}});
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const auto body = doppel::bench::make_body();
  for (int64_t batch : {1, 4, 16}) doppel::bench::run(body, batch);
}
