#include <ATen/Parallel.h>

#include <algorithm>
#include <tuple>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/embedded_deformation/embedded_deformation_checks.h"
#include "doppel/layers/embedded_deformation/embedded_deformation_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kDeformationOp = "doppel::embedded_deformation";
constexpr int64_t kDeformationBlock = 16;
constexpr int64_t kMaxLanes = 16;

/// The constants of the schema's `graph`, in this order.
enum Constant {
  kRest,
  kNodes,
  kCentre,
  kOffsets,
  kItems,
  kWeights,
  kTransposedOffsets,
  kTransposedItems,
  kTransposedWeights,
  kConstants
};

std::vector<Tensor> constants_of(const DeformationGraph& graph) {
  const SparseRows& w = graph.weights;
  return {graph.rest_float, graph.nodes_float,    graph.centre,       w.offsets,           w.items,
          w.weights,        w.transposed_offsets, w.transposed_items, w.transposed_weights};
}

/// The data of one call. The tensors own the memory that `params` points to.
struct DeformationCall {
  Tensor A, T, D, M, table, pose_table, origin;
  DeformationParams params{};
  int64_t batch = 0;

  DeformationCall(const Tensor& A_in, const Tensor& T_in, const OptionalTensor& D_in, const OptionalTensor& M_in,
                  at::TensorList graph) {
    TORCH_CHECK(graph.size() == kConstants, kDeformationOp, ": graph must hold ", static_cast<int>(kConstants),
                " tensors");
    take_constants(graph);
    const int64_t N = params.num_vertices, K = params.num_nodes;
    check_floats(kDeformationOp, "A", A_in, {-1, K, 3}, "[B,K,3]");
    batch = A_in.size(0);
    check_floats(kDeformationOp, "T", T_in, {batch, K, 3});
    A = A_in.contiguous();
    T = T_in.contiguous();
    params.angles = A.data_ptr<float>();
    params.translations = T.data_ptr<float>();
    if (D_in && D_in->defined()) {
      check_floats(kDeformationOp, "D", *D_in, {batch, N, 3});
      D = D_in->contiguous();
      params.displacements = D.data_ptr<float>();
    }
    if (M_in && M_in->defined()) {
      check_floats(kDeformationOp, "node_transforms", *M_in, {batch, K, 3, 4});
      M = M_in->contiguous();
      params.node_transforms = M.data_ptr<float>();
    }
  }

  void take_constants(at::TensorList graph) {
    params.num_vertices = graph[kRest].size(0);
    params.num_nodes = graph[kNodes].size(0);
    params.rest = graph[kRest].data_ptr<float>();
    params.nodes = graph[kNodes].data_ptr<float>();
    params.centre = graph[kCentre].data_ptr<float>();
    params.offsets = graph[kOffsets].data_ptr<int32_t>();
    params.items = graph[kItems].data_ptr<int32_t>();
    params.weights = graph[kWeights].data_ptr<float>();
    params.transposed_offsets = graph[kTransposedOffsets].data_ptr<int32_t>();
    params.transposed_items = graph[kTransposedItems].data_ptr<int32_t>();
    params.transposed_weights = graph[kTransposedWeights].data_ptr<float>();
  }

  Tensor lanes_of(int64_t numbers) const {
    // A chunk has 4, 8 or 16 lanes, so 16 suffice for any instruction set.
    const int64_t lanes = batch > 8 ? 16 : batch > 4 ? 8 : 4;
    return at::empty({numbers * lanes}, A.options());
  }

  /// Calls `work` for each group of items. @param tables whether `work` needs the nodes' tables
  template <typename Work>
  void for_each_chunk(bool tables, const Work& work) {
    if (tables) {
      table = lanes_of(params.num_nodes * 12);
      params.table = table.data_ptr<float>();
      if (M.defined()) {
        pose_table = lanes_of(params.num_nodes * 12);
        origin = lanes_of(3);
        params.pose_table = pose_table.data_ptr<float>();
        params.origin = origin.data_ptr<float>();
      }
    }
    for (params.first = 0; params.first < batch; params.first += params.count) {
      params.lanes = kernels::deformation_lanes(batch - params.first);
      params.count = static_cast<int>(std::min<int64_t>(params.lanes, batch - params.first));
      if (tables) prepare();
      work();
    }
  }

  void prepare() {
    if (M.defined()) kernels::deformation_prepare_origin(params);
    in_blocks(params.num_nodes, [&](int64_t begin, int64_t end) { kernels::deformation_prepare(params, begin, end); });
  }

  template <typename Work>
  static void in_blocks(int64_t count, const Work& work) {
    at::parallel_for(0, (count + kDeformationBlock - 1) / kDeformationBlock, 4, [&](int64_t begin, int64_t end) {
      work(begin * kDeformationBlock, std::min(end * kDeformationBlock, count));
    });
  }
};

Tensor deformation_cpu(const Tensor& A, const Tensor& T, const OptionalTensor& D, const OptionalTensor& node_transforms,
                       at::TensorList graph) {
  DeformationCall call(A, T, D, node_transforms, graph);
  DeformationParams& p = call.params;
  const Tensor out = at::empty({call.batch, p.num_vertices, 3}, call.A.options());
  p.out = out.data_ptr<float>();
  call.for_each_chunk(true, [&] {
    DeformationCall::in_blocks(p.num_vertices,
                               [&](int64_t begin, int64_t end) { kernels::deformation_forward(p, begin, end); });
  });
  return out;
}

/// @param wants which of A with T, D, node_transforms need a gradient
/// @return gradients to A, T, D, node_transforms; undefined where not wanted
std::tuple<Tensor, Tensor, Tensor, Tensor> deformation_backward_cpu(const Tensor& grad_in, const Tensor& A,
                                                                    const Tensor& T, const OptionalTensor& D,
                                                                    const OptionalTensor& node_transforms,
                                                                    at::TensorList graph, std::array<bool, 3> wants) {
  DeformationCall call(A, T, D, node_transforms, graph);
  DeformationParams& p = call.params;
  check_floats(kDeformationOp, "the gradient", grad_in, {call.batch, p.num_vertices, 3});
  const Tensor grad = grad_in.contiguous();
  p.grad_out = grad.data_ptr<float>();
  Tensor grad_A, grad_T, grad_D, grad_M;
  if (wants[0]) {
    grad_A = at::empty_like(call.A);
    grad_T = at::empty_like(call.T);
    p.grad_angles = grad_A.data_ptr<float>();
    p.grad_translations = grad_T.data_ptr<float>();
  }
  const bool posed = call.M.defined();
  if (wants[1] && call.D.defined()) {
    grad_D = posed ? at::empty_like(call.D) : grad.clone();
    if (posed) p.grad_displacements = grad_D.data_ptr<float>();
  }
  if (wants[2] && posed) {
    grad_M = at::empty_like(call.M);
    p.grad_node_transforms = grad_M.data_ptr<float>();
  }
  if (!wants[0] && !posed) return {grad_A, grad_T, grad_D, grad_M};

  const Tensor scratch = call.lanes_of(p.num_vertices * 3 * (posed ? 3 : 1));
  const int64_t plane = scratch.numel() / (posed ? 3 : 1);
  p.canonical_gradient = scratch.data_ptr<float>();
  p.posed_gradient = posed ? p.canonical_gradient + plane : nullptr;
  p.canonical = posed ? p.posed_gradient + plane : nullptr;
  call.for_each_chunk(posed, [&] {
    DeformationCall::in_blocks(
        p.num_vertices, [&](int64_t begin, int64_t end) { kernels::deformation_backward_vertices(p, begin, end); });
    if (!wants[0] && !p.grad_node_transforms) return;
    DeformationCall::in_blocks(p.num_nodes,
                               [&](int64_t begin, int64_t end) { kernels::deformation_backward_nodes(p, begin, end); });
  });
  return {grad_A, grad_T, grad_D, grad_M};
}

Tensor call_forward(const Tensor& A, const Tensor& T, const Tensor& D, const Tensor& M, at::TensorList graph) {
  static const auto op = find_op<decltype(deformation_cpu)>(kDeformationOp);
  return op.call(A, T, optional_of(D), optional_of(M), graph);
}

class DeformationFunction : public torch::autograd::Function<DeformationFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& A, const Tensor& T, const OptionalTensor& optional_D,
                        const OptionalTensor& optional_M, const std::vector<Tensor>& graph) {
    const Tensor D = optional_D.value_or(Tensor()), M = optional_M.value_or(Tensor());
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    ctx->save_for_backward({A, T, D, M});
    ctx->saved_data["graph"] = graph;
    ctx->saved_data["wants_nodes"] = A.requires_grad() || T.requires_grad();
    ctx->saved_data["wants_D"] = D.defined() && D.requires_grad();
    ctx->saved_data["wants_M"] = M.defined() && M.requires_grad();
    return call_forward(A, T, D, M, graph);
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    static const auto op = find_op<decltype(deformation_backward_cpu)>("doppel::embedded_deformation_backward");
    const variable_list saved = ctx->get_saved_variables();
    const std::vector<Tensor> graph = ctx->saved_data["graph"].toTensorVector();
    const std::array<bool, 3> wants = {ctx->saved_data["wants_nodes"].toBool(), ctx->saved_data["wants_D"].toBool(),
                                       ctx->saved_data["wants_M"].toBool()};
    Tensor A, T, D, M;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      std::tie(A, T, D, M) =
          op.call(grads[0], saved[0], saved[1], optional_of(saved[2]), optional_of(saved[3]), graph, wants);
    }
    return once_differentiable({A, T, D, M, Tensor()}, kDeformationOp);
  }
};

Tensor deformation_autograd(const Tensor& A, const Tensor& T, const OptionalTensor& D, const OptionalTensor& M,
                            at::TensorList graph) {
  return DeformationFunction::apply(A, T, D, M, graph.vec());
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("embedded_deformation(Tensor A, Tensor T, Tensor? D, Tensor? node_transforms, Tensor[] graph) -> Tensor");
  m.def(
      "embedded_deformation_backward(Tensor grad, Tensor A, Tensor T, Tensor? D, Tensor? node_transforms, "
      "Tensor[] graph, bool[3] wants) -> (Tensor, Tensor, Tensor, Tensor)");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("embedded_deformation", TORCH_FN(deformation_cpu));
  m.impl("embedded_deformation_backward", TORCH_FN(deformation_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("embedded_deformation", TORCH_FN(deformation_autograd)); }

}  // namespace

torch::Tensor embedded_deformation(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                   const torch::Tensor& node_transforms, const DeformationGraph& graph) {
  check_deformation_arguments(A, T, D, node_transforms, graph);
  if (!takes_kernel(A)) return embedded_deformation_reference(A, T, D, node_transforms, graph);
  return call_forward(A, T, D, node_transforms, constants_of(graph));
}

}  // namespace doppel
