#pragma once

#include <torch/types.h>

namespace doppel {

/// During the lifetime of a ReferenceScope, layers on this thread run their reference instead of their kernel.
class ReferenceScope {
 public:
  ReferenceScope();
  ~ReferenceScope();
  ReferenceScope(const ReferenceScope&) = delete;
  ReferenceScope& operator=(const ReferenceScope&) = delete;

 private:
  bool before_;
};

/// During the lifetime of a KernelTraceScope, a torch::jit trace on this thread records the calls of kernels as ops of
/// the library `doppel`, instead of the plain operations of the references. Only programs with these ops can run it.
class KernelTraceScope {
 public:
  KernelTraceScope();
  ~KernelTraceScope();
  KernelTraceScope(const KernelTraceScope&) = delete;
  KernelTraceScope& operator=(const KernelTraceScope&) = delete;

 private:
  bool before_;
};

/// Whether a ReferenceScope is alive on this thread.
bool in_reference_scope();

/// Whether a layer called with `input` runs its kernel: float32 on the CPU, no ReferenceScope, and not inside a
/// torch::jit trace, which has to hold plain tensor operations only unless a KernelTraceScope is alive.
bool takes_kernel(const torch::Tensor& input);

}  // namespace doppel
