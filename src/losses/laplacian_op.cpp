#include <ATen/Parallel.h>

#include <tuple>
#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/laplacian.h"
#include "doppel/losses/laplacian_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kLaplacianOp = "doppel::laplacian_loss";

/// @param graph offsets, neighbours, weight
/// @return the loss, and its gradient to V_fi (empty unless wanted)
std::tuple<Tensor, Tensor> laplacian_cpu(const Tensor& V_fi_in, const Tensor& V_co_in, at::TensorList graph,
                                         bool with_gradient) {
  TORCH_CHECK(graph.size() == 3, kLaplacianOp, ": graph must hold offsets, neighbours, weight");
  const int64_t N = graph[2].size(0), edges = graph[1].size(0), batch = V_fi_in.size(0);
  check_floats(kLaplacianOp, "V_fi", V_fi_in, {-1, N, 3}, "[B,N,3]");
  check_floats(kLaplacianOp, "V_co", V_co_in, V_fi_in.sizes(), "[B,N,3]");
  const Tensor V_fi = V_fi_in.contiguous(), V_co = V_co_in.contiguous();
  Tensor gradient = with_gradient ? at::empty(V_fi.sizes(), V_fi.options()) : at::empty({0}, V_fi.options());
  if (batch == 0 || edges == 0) return {at::zeros({}, V_fi.options()), gradient.zero_()};
  const double scale = 1.0 / (static_cast<double>(batch) * static_cast<double>(edges));
  std::vector<double> sums(batch);
  at::parallel_for(0, batch, 1, [&](int64_t begin, int64_t end) {
    std::vector<float> scratch(8 * N);
    for (int64_t b = begin; b < end; ++b) {
      LaplacianParams p{};
      p.num_vertices = N;
      p.offsets = graph[0].data_ptr<int32_t>();
      p.neighbours = graph[1].data_ptr<int32_t>();
      p.weight = graph[2].data_ptr<float>();
      p.refined = V_fi.data_ptr<float>() + 3 * N * b;
      p.coarse = V_co.data_ptr<float>() + 3 * N * b;
      p.displacement = scratch.data();
      p.laplacian = scratch.data() + 4 * N;
      p.scale = static_cast<float>(scale);
      p.gradient = with_gradient ? gradient.data_ptr<float>() + 3 * N * b : nullptr;
      kernels::laplacian_item(p);
      sums[b] = p.sum;
    }
  });
  double sum = 0.0;
  for (double part : sums) sum += part;
  return {at::full({}, sum * scale, V_fi.options()), gradient};
}

class LaplacianFunction : public torch::autograd::Function<LaplacianFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& V_fi, const Tensor& V_co,
                        const std::vector<Tensor>& graph) {
    static const auto op = find_op<decltype(laplacian_cpu)>(kLaplacianOp);
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    auto [loss, gradient] = op.call(V_fi, V_co, graph, V_fi.requires_grad());
    ctx->save_for_backward({gradient});
    return loss;
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    Tensor to_vertices;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      to_vertices = ctx->get_saved_variables()[0] * grads[0];
    }
    return once_differentiable({to_vertices, Tensor(), Tensor()}, kLaplacianOp);
  }
};

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("laplacian_loss(Tensor V_fi, Tensor V_co, Tensor[] graph, bool with_gradient) -> (Tensor, Tensor)");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) { m.impl("laplacian_loss", TORCH_FN(laplacian_cpu)); }

}  // namespace

torch::Tensor laplacian_loss(const torch::Tensor& V_fi, const torch::Tensor& V_co, const LaplacianGraph& graph) {
  check_shape("laplacian_loss", "V_fi", V_fi, {-1, graph.num_vertices, 3}, "[B,N,3]");
  check_shape("laplacian_loss", "V_co", V_co, {V_fi.size(0), graph.num_vertices, 3}, "[B,N,3]");
  check_same_kind("laplacian_loss", "V_co", V_co, V_fi);
  if (!takes_kernel(V_fi)) return laplacian_loss_reference(V_fi, V_co, graph);
  return LaplacianFunction::apply(V_fi, V_co.detach(),
                                  std::vector<Tensor>{graph.offsets, graph.neighbours, graph.weight_float});
}

}  // namespace doppel
