#pragma once

/// Calls of ops of the library `doppel` through the dispatcher.

#include <torch/library.h>

namespace doppel {

/// The op registered under `name`, with the type of its kernel. The search takes a lock: keep the result in a static
/// variable.
template <typename Signature>
c10::TypedOperatorHandle<Signature> find_op(const char* name) {
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Signature>();
}

}  // namespace doppel
