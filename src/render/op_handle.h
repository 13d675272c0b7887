#pragma once

#include <torch/library.h>

namespace doppel::render {

/// The op registered under `name`, with the type of its kernel. The search takes a lock: keep the result in a static
/// variable.
template <typename Signature>
auto find_op(const char* name) {
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Signature>();
}

}  // namespace doppel::render
