#include <ATen/Parallel.h>

#include <algorithm>
#include <tuple>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/layers/skinning/skinning_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kSkinningOp = "doppel::skinning";
// The points are divided into this many parts for any number of threads, so that sums over them have the same bits.
constexpr int64_t kParts = 8;
constexpr int64_t kSkinningBlock = 16;

/// The data of one call. The tensors own the memory that `params` points to.
struct SkinningCall {
  Tensor points, bones, table, frame;
  SkinningParams params{};
  int64_t batch = 0;

  /// @param points undefined: blend only. @param rows offsets, items, weights
  SkinningCall(const Tensor& points_in, const Tensor& bones_in, at::TensorList rows, int64_t mode) {
    TORCH_CHECK(rows.size() == 3 && rows[0].scalar_type() == torch::kInt32 && rows[1].scalar_type() == torch::kInt32 &&
                    rows[2].scalar_type() == torch::kFloat32,
                kSkinningOp, ": weights must be int32 offsets, int32 items, float32 weights");
    check_floats(kSkinningOp, "bones", bones_in, {-1, -1, 3, 4}, "[B,Bn,3,4]");
    bones = bones_in.contiguous();
    batch = bones.size(0);
    params.num_points = rows[0].size(0) - 1;
    params.num_bones = bones.size(1);
    params.offsets = rows[0].data_ptr<int32_t>();
    params.items = rows[1].data_ptr<int32_t>();
    params.weights = rows[2].data_ptr<float>();
    params.linear = mode == static_cast<int64_t>(SkinningMode::linear);
    params.blend_only = !points_in.defined();
    params.bones = bones.data_ptr<float>();
    if (points_in.defined()) take_points(points_in);
    table = at::empty({params.num_bones * (params.linear ? 12 : 8) * 16}, bones.options());
    frame = at::empty({6 * 16}, bones.options());
    params.table = table.data_ptr<float>();
    params.frame = frame.data_ptr<float>();
  }

  void take_points(const Tensor& points_in) {
    const bool shared = points_in.dim() == 2;
    if (shared) {
      check_floats(kSkinningOp, "points", points_in, {params.num_points, 3}, "[N,3]");
    } else {
      check_floats(kSkinningOp, "points", points_in, {batch, params.num_points, 3}, "[B,N,3]");
    }
    points = points_in.contiguous();
    params.points = points.data_ptr<float>();
    params.point_stride = shared ? 0 : 3 * params.num_points;
  }

  /// Prepares the bones of each group of items and calls `work` for it.
  template <typename Work>
  void for_each_chunk(const Work& work) {
    for (params.first = 0; params.first < batch; params.first += params.count) {
      params.lanes = kernels::skinning_lanes(batch - params.first);
      params.count = static_cast<int>(std::min<int64_t>(params.lanes, batch - params.first));
      kernels::skinning_prepare_frame(params);
      at::parallel_for(0, params.num_bones, 16,
                       [&](int64_t begin, int64_t end) { kernels::skinning_prepare(params, begin, end); });
      work();
    }
  }
};

Tensor run_forward(const Tensor& points, const Tensor& bones, at::TensorList rows, int64_t mode) {
  SkinningCall call(points, bones, rows, mode);
  const int64_t N = call.params.num_points;
  const Tensor out = call.params.blend_only ? at::empty({call.batch, N, 3, 4}, call.bones.options())
                                            : at::empty({call.batch, N, 3}, call.bones.options());
  if (N == 0) return out;
  call.params.out = out.data_ptr<float>();
  call.for_each_chunk([&] {
    at::parallel_for(0, (N + kSkinningBlock - 1) / kSkinningBlock, 8, [&](int64_t begin, int64_t end) {
      kernels::skinning_forward(call.params, begin * kSkinningBlock, std::min(end * kSkinningBlock, N));
    });
  });
  return out;
}

std::tuple<Tensor, Tensor> run_backward(const Tensor& grad_in, const Tensor& points, const Tensor& bones,
                                        at::TensorList rows, int64_t mode, bool wants_points, bool wants_bones) {
  SkinningCall call(points, bones, rows, mode);
  SkinningParams& p = call.params;
  const Tensor grad = grad_in.contiguous();
  TORCH_CHECK(
      grad.scalar_type() == torch::kFloat32 && grad.numel() == call.batch * p.num_points * (p.blend_only ? 12 : 3),
      kSkinningOp, "_backward: unexpected gradient ", describe(grad_in));
  Tensor grad_points, grad_bones, tables;
  if (wants_points) {
    grad_points = p.point_stride == 0 ? at::zeros_like(call.points) : at::empty_like(call.points);
    p.grad_points = grad_points.data_ptr<float>();
  }
  const int64_t blocks = (p.num_points + kSkinningBlock - 1) / kSkinningBlock;
  p.num_parts = std::min(kParts, std::max<int64_t>(1, blocks));
  if (wants_bones) {
    grad_bones = at::empty_like(call.bones);
    if (p.num_points == 0) grad_bones.zero_();
    p.grad_bones = grad_bones.data_ptr<float>();
    tables = at::empty({p.num_parts, call.table.numel()}, call.bones.options());
    p.grad_tables = tables.data_ptr<float>();
  }
  if (p.num_points == 0) return {grad_points, grad_bones};
  p.grad_out = grad.data_ptr<float>();
  call.for_each_chunk([&] {
    const int64_t part_size = p.num_bones * (p.linear ? 12 : 8) * p.lanes;
    at::parallel_for(0, p.num_parts, 1, [&](int64_t begin, int64_t end) {
      for (int64_t part = begin; part < end; ++part) {
        if (wants_bones) std::fill_n(p.grad_tables + part * part_size, part_size, 0.0f);
        const int64_t first = part * blocks / p.num_parts, last = (part + 1) * blocks / p.num_parts;
        kernels::skinning_backward(p, first * kSkinningBlock, std::min(last * kSkinningBlock, p.num_points), part);
      }
    });
    if (!wants_bones) return;
    at::parallel_for(0, p.num_bones, 16, [&](int64_t begin, int64_t end) { kernels::skinning_finish(p, begin, end); });
  });
  return {grad_points, grad_bones};
}

Tensor skinning_cpu(const OptionalTensor& points, const Tensor& bones, at::TensorList rows, int64_t mode) {
  return run_forward(points.value_or(Tensor()), bones, rows, mode);
}

std::tuple<Tensor, Tensor> skinning_backward_cpu(const Tensor& grad, const OptionalTensor& points, const Tensor& bones,
                                                 at::TensorList rows, int64_t mode, bool wants_points,
                                                 bool wants_bones) {
  return run_backward(grad, points.value_or(Tensor()), bones, rows, mode, wants_points, wants_bones);
}

Tensor call_forward(const Tensor& points, const Tensor& bones, at::TensorList rows, int64_t mode) {
  static const auto op = find_op<decltype(skinning_cpu)>(kSkinningOp);
  return op.call(optional_of(points), bones, rows, mode);
}

std::tuple<Tensor, Tensor> call_backward(const Tensor& grad, const Tensor& points, const Tensor& bones,
                                         at::TensorList rows, int64_t mode, bool wants_points, bool wants_bones) {
  static const auto op = find_op<decltype(skinning_backward_cpu)>("doppel::skinning_backward");
  return op.call(grad, optional_of(points), bones, rows, mode, wants_points, wants_bones);
}

class SkinningFunction : public torch::autograd::Function<SkinningFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const OptionalTensor& optional_points, const Tensor& bones,
                        const std::vector<Tensor>& rows, int64_t mode) {
    const Tensor points = optional_points.value_or(Tensor());
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    ctx->save_for_backward({points, bones});
    ctx->saved_data["rows"] = rows;
    ctx->saved_data["mode"] = mode;
    ctx->saved_data["wants_points"] = points.defined() && points.requires_grad();
    ctx->saved_data["wants_bones"] = bones.requires_grad();
    return call_forward(points, bones, rows, mode);
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    const variable_list saved = ctx->get_saved_variables();
    const std::vector<Tensor> rows = ctx->saved_data["rows"].toTensorVector();
    Tensor grad_points, grad_bones;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      std::tie(grad_points, grad_bones) =
          call_backward(grads[0], saved[0], saved[1], rows, ctx->saved_data["mode"].toInt(),
                        ctx->saved_data["wants_points"].toBool(), ctx->saved_data["wants_bones"].toBool());
    }
    return once_differentiable({grad_points, grad_bones, Tensor(), Tensor()}, kSkinningOp);
  }
};

Tensor skinning_autograd(const OptionalTensor& points, const Tensor& bones, at::TensorList rows, int64_t mode) {
  return SkinningFunction::apply(points, bones, rows.vec(), mode);
}

// Without points the op returns the blended transforms.
TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("skinning(Tensor? points, Tensor bones, Tensor[] rows, int mode) -> Tensor");
  m.def(
      "skinning_backward(Tensor grad, Tensor? points, Tensor bones, Tensor[] rows, int mode, bool wants_points, "
      "bool wants_bones) -> (Tensor, Tensor)");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("skinning", TORCH_FN(skinning_cpu));
  m.impl("skinning_backward", TORCH_FN(skinning_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("skinning", TORCH_FN(skinning_autograd)); }

}  // namespace

torch::Tensor skinning(const torch::Tensor& points, const torch::Tensor& bones, const SparseRows& weights,
                       SkinningMode mode) {
  check_shape("skinning", "bones", bones, {-1, weights.num_columns, 3, 4}, "[B,Bn,3,4]");
  if (points.defined() && points.dim() == 2) {
    check_shape("skinning", "points", points, {weights.num_rows, 3}, "[N,3]");
  } else {
    check_shape("skinning", "points", points, {bones.size(0), weights.num_rows, 3}, "[B,N,3]");
  }
  check_same_kind("skinning", "points", points, bones);
  if (!takes_kernel(bones)) return skinning_reference(points, bones, weights, mode);
  return call_forward(points, bones, {weights.offsets, weights.items, weights.weights}, static_cast<int64_t>(mode));
}

torch::Tensor skinning_blend(const torch::Tensor& bones, const SparseRows& weights, SkinningMode mode) {
  check_shape("skinning", "bones", bones, {-1, weights.num_columns, 3, 4}, "[B,Bn,3,4]");
  if (!takes_kernel(bones)) return skinning_blend_reference(bones, weights, mode);
  return call_forward({}, bones, {weights.offsets, weights.items, weights.weights}, static_cast<int64_t>(mode));
}

}  // namespace doppel
