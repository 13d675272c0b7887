#include "doppel/core/tensor/reference_scope.h"

#include <torch/csrc/jit/frontend/tracer.h>

namespace doppel {
namespace {
thread_local bool reference_only = false;
thread_local bool traces_kernels = false;
}  // namespace

ReferenceScope::ReferenceScope() : before_(reference_only) { reference_only = true; }
ReferenceScope::~ReferenceScope() { reference_only = before_; }

KernelTraceScope::KernelTraceScope() : before_(traces_kernels) { traces_kernels = true; }
KernelTraceScope::~KernelTraceScope() { traces_kernels = before_; }

bool in_reference_scope() { return reference_only; }

bool takes_kernel(const torch::Tensor& input) {
  return input.scalar_type() == torch::kFloat32 && input.device().is_cpu() && !reference_only &&
         (traces_kernels || !torch::jit::tracer::isTracing());
}

}  // namespace doppel
