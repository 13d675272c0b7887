#include <ATen/Parallel.h>

#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/kinematics/kinematics_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kKinematicsOp = "doppel::forward_kinematics";

void check_arguments(const Tensor& dofs, const Tensor& weights_of, const Tensor& frame_joint,
                     const Tensor& frame_local) {
  check_floats(kKinematicsOp, "dofs", dofs, {-1, -1}, "[B,D]");
  TORCH_CHECK(weights_of.scalar_type() == torch::kFloat64 && frame_local.scalar_type() == torch::kFloat64,
              kKinematicsOp, ": geometry, drive_weight and frame_local must be float64");
  TORCH_CHECK(frame_local.dim() == 3 && frame_local.size(0) == frame_joint.size(0), kKinematicsOp,
              ": frame_joint and frame_local differ: ", describe(frame_joint), " and ", describe(frame_local));
}

/// The chain's tensors in the order of the schema.
KinematicsParams make_params(const Tensor& dofs, at::TensorList chain) {
  check_arguments(dofs, chain[5], chain[6], chain[7]);
  KinematicsParams p{};
  p.num_joints = chain[0].size(0);
  p.num_dofs = dofs.size(1);
  p.num_frames = chain[6].size(0);
  p.parent = chain[0].data_ptr<int32_t>();
  p.prismatic = chain[1].data_ptr<int32_t>();
  p.geometry = chain[2].data_ptr<double>();
  p.drive_offsets = chain[3].data_ptr<int32_t>();
  p.drive_dof = chain[4].data_ptr<int32_t>();
  p.drive_weight = chain[5].data_ptr<double>();
  p.frame_joint = chain[6].data_ptr<int32_t>();
  p.frame_local = chain[7].data_ptr<double>();
  p.dofs = dofs.data_ptr<float>();
  return p;
}

/// @param chain parent, prismatic, geometry, drive_offsets, drive_dof, drive_weight, frame_joint, frame_local
Tensor kinematics_cpu(const Tensor& dofs_in, at::TensorList chain) {
  const Tensor dofs = dofs_in.contiguous();
  KinematicsParams p = make_params(dofs, chain);
  Tensor frames = at::empty({dofs.size(0), p.num_frames, 3, 4}, dofs.options());
  p.frames = frames.data_ptr<float>();
  at::parallel_for(0, dofs.size(0), 1, [&](int64_t begin, int64_t end) {
    std::vector<double> scratch(12 * p.num_joints);
    kernels::kinematics_forward(p, begin, end, scratch.data());
  });
  return frames;
}

Tensor kinematics_backward_cpu(const Tensor& grad_frames_in, const Tensor& dofs_in, at::TensorList chain) {
  const Tensor grad_frames = grad_frames_in.contiguous(), dofs = dofs_in.contiguous();
  KinematicsParams p = make_params(dofs, chain);
  TORCH_CHECK(grad_frames.scalar_type() == torch::kFloat32 && grad_frames.numel() == dofs.size(0) * p.num_frames * 12,
              kKinematicsOp, "_backward: grad_frames must be float32 [B,M,3,4], found ", describe(grad_frames));
  Tensor grad_dofs = at::empty_like(dofs);
  p.grad_frames = grad_frames.data_ptr<float>();
  p.grad_dofs = grad_dofs.data_ptr<float>();
  at::parallel_for(0, dofs.size(0), 1, [&](int64_t begin, int64_t end) {
    std::vector<double> scratch(24 * p.num_joints + p.num_dofs);
    kernels::kinematics_backward(p, begin, end, scratch.data());
  });
  return grad_dofs;
}

Tensor call_forward(const Tensor& dofs, at::TensorList chain) {
  static const auto op = find_op<Tensor(const Tensor&, at::TensorList)>(kKinematicsOp);
  return op.call(dofs, chain);
}

Tensor call_backward(const Tensor& grad_frames, const Tensor& dofs, at::TensorList chain) {
  static const auto op =
      find_op<Tensor(const Tensor&, const Tensor&, at::TensorList)>("doppel::forward_kinematics_backward");
  return op.call(grad_frames, dofs, chain);
}

class KinematicsFunction : public torch::autograd::Function<KinematicsFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& dofs, const std::vector<Tensor>& chain) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    ctx->save_for_backward({dofs});
    ctx->saved_data["chain"] = chain;
    return call_forward(dofs, chain);
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    const Tensor dofs = ctx->get_saved_variables()[0];
    const std::vector<Tensor> chain = ctx->saved_data["chain"].toTensorVector();
    Tensor grad_dofs;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      grad_dofs = call_backward(grads[0], dofs, chain);
    }
    return once_differentiable({grad_dofs, Tensor()}, kKinematicsOp);
  }
};

Tensor kinematics_autograd(const Tensor& dofs, at::TensorList chain) {
  return KinematicsFunction::apply(dofs, chain.vec());
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("forward_kinematics(Tensor dofs, Tensor[] chain) -> Tensor");
  m.def("forward_kinematics_backward(Tensor grad_frames, Tensor dofs, Tensor[] chain) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("forward_kinematics", TORCH_FN(kinematics_cpu));
  m.impl("forward_kinematics_backward", TORCH_FN(kinematics_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("forward_kinematics", TORCH_FN(kinematics_autograd)); }

}  // namespace

torch::Tensor forward_kinematics(const torch::Tensor& dofs, const KinematicChain& chain, const RiddenFrames& frames) {
  check_shape("forward_kinematics", "dofs", dofs, {-1, chain.num_dofs}, "[B,D]");
  if (!takes_kernel(dofs)) return forward_kinematics_reference(dofs, chain, frames);
  return call_forward(dofs, {chain.parent, chain.prismatic, chain.geometry, chain.drive_offsets, chain.drive_dof,
                             chain.drive_weight, frames.joint, frames.local});
}

}  // namespace doppel
