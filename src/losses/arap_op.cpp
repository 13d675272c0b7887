#include <ATen/Parallel.h>

#include <algorithm>
#include <tuple>
#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/arap.h"
#include "doppel/losses/arap_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kArapOp = "doppel::arap_loss";
constexpr int64_t kArapBlock = 16;

/// The data of one call. The tensors own the memory that `params` points to.
struct ArapCall {
  Tensor A, T, table;
  ArapParams params{};
  int64_t batch = 0, blocks = 0, edges = 0;

  /// @param graph offsets, targets, rigidity, rest
  ArapCall(const Tensor& A_in, const Tensor& T_in, at::TensorList graph) {
    TORCH_CHECK(graph.size() == 4, kArapOp, ": graph must hold offsets, targets, rigidity, rest");
    params.num_nodes = graph[0].size(0) - 1;
    check_floats(kArapOp, "A", A_in, {-1, params.num_nodes, 3}, "[B,K,3]");
    check_floats(kArapOp, "T", T_in, A_in.sizes(), "[B,K,3]");
    A = A_in.contiguous();
    T = T_in.contiguous();
    batch = A.size(0);
    edges = graph[1].size(0);
    blocks = (params.num_nodes + kArapBlock - 1) / kArapBlock;
    table = at::empty({params.num_nodes * 12 * 16}, A.options());
    params.offsets = graph[0].data_ptr<int32_t>();
    params.targets = graph[1].data_ptr<int32_t>();
    params.rigidity = graph[2].data_ptr<float>();
    params.rest = graph[3].data_ptr<float>();
    params.angles = A.data_ptr<float>();
    params.translations = T.data_ptr<float>();
    params.table = table.data_ptr<float>();
  }

  bool is_empty() const { return batch == 0 || edges == 0; }

  template <typename Work>
  void in_blocks(const Work& work) const {
    at::parallel_for(0, blocks, 8, [&](int64_t begin, int64_t end) {
      work(begin * kArapBlock, std::min(end * kArapBlock, params.num_nodes));
    });
  }

  template <typename Work>
  void for_each_chunk(const Work& work) {
    for (params.first = 0; params.first < batch; params.first += params.count) {
      params.lanes = kernels::arap_lanes(batch - params.first);
      params.count = static_cast<int>(std::min<int64_t>(params.lanes, batch - params.first));
      in_blocks([&](int64_t begin, int64_t end) { kernels::arap_prepare(params, begin, end); });
      in_blocks(work);
    }
  }
};

Tensor arap_cpu(const Tensor& A, const Tensor& T, at::TensorList graph) {
  ArapCall call(A, T, graph);
  if (call.is_empty()) return at::zeros({}, A.options());
  std::vector<double> sums(call.blocks, 0.0);
  call.params.sums = sums.data();
  call.for_each_chunk([&](int64_t begin, int64_t end) { kernels::arap_forward(call.params, begin, end); });
  double sum = 0.0;
  for (double part : sums) sum += part;
  return at::full({}, sum / (static_cast<double>(call.batch) * call.edges), A.options());
}

std::tuple<Tensor, Tensor> arap_backward_cpu(const Tensor& grad, const Tensor& A, const Tensor& T,
                                             at::TensorList graph) {
  ArapCall call(A, T, graph);
  Tensor grad_A = at::zeros_like(call.A), grad_T = at::zeros_like(call.T);
  if (call.is_empty()) return {grad_A, grad_T};
  ArapParams& p = call.params;
  p.scale = static_cast<float>(grad.item<double>() / (static_cast<double>(call.batch) * call.edges));
  p.grad_angles = grad_A.data_ptr<float>();
  p.grad_translations = grad_T.data_ptr<float>();
  call.for_each_chunk([&](int64_t begin, int64_t end) { kernels::arap_backward(p, begin, end); });
  return {grad_A, grad_T};
}

Tensor call_forward(const Tensor& A, const Tensor& T, at::TensorList graph) {
  static const auto op = find_op<decltype(arap_cpu)>(kArapOp);
  return op.call(A, T, graph);
}

class ArapFunction : public torch::autograd::Function<ArapFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& A, const Tensor& T, const std::vector<Tensor>& graph) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    ctx->save_for_backward({A, T});
    ctx->saved_data["graph"] = graph;
    return call_forward(A, T, graph);
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    static const auto op = find_op<decltype(arap_backward_cpu)>("doppel::arap_loss_backward");
    const variable_list saved = ctx->get_saved_variables();
    const std::vector<Tensor> graph = ctx->saved_data["graph"].toTensorVector();
    Tensor grad_A, grad_T;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      std::tie(grad_A, grad_T) = op.call(grads[0], saved[0], saved[1], graph);
    }
    return once_differentiable({grad_A, grad_T, Tensor()}, kArapOp);
  }
};

Tensor arap_autograd(const Tensor& A, const Tensor& T, at::TensorList graph) {
  return ArapFunction::apply(A, T, graph.vec());
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("arap_loss(Tensor A, Tensor T, Tensor[] graph) -> Tensor");
  m.def("arap_loss_backward(Tensor grad, Tensor A, Tensor T, Tensor[] graph) -> (Tensor, Tensor)");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("arap_loss", TORCH_FN(arap_cpu));
  m.impl("arap_loss_backward", TORCH_FN(arap_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("arap_loss", TORCH_FN(arap_autograd)); }

}  // namespace

torch::Tensor arap_loss(const torch::Tensor& A, const torch::Tensor& T, const ArapGraph& graph) {
  check_shape("arap_loss", "A", A, {-1, graph.num_nodes, 3}, "[B,K,3]");
  check_shape("arap_loss", "T", T, {A.size(0), graph.num_nodes, 3}, "[B,K,3]");
  check_same_kind("arap_loss", "T", T, A);
  if (!takes_kernel(A)) return arap_loss_reference(A, T, graph);
  return call_forward(A, T, {graph.offsets, graph.targets, graph.rigidity_float, graph.rest_float});
}

}  // namespace doppel
