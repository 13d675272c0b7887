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

/// Whether a ReferenceScope is alive on this thread.
bool in_reference_scope();

/// Whether a layer called with `input` runs its kernel: float32 on the CPU, no ReferenceScope, and not inside a
/// torch::jit trace, which has to hold plain tensor operations only.
bool takes_kernel(const torch::Tensor& input);

}  // namespace doppel
