#pragma once

#include <torch/types.h>

namespace doppel::render {

/// A tensor with undefined content. When the last reference to it ends, its memory returns to a store for the next
/// tensor of the same size, because the page faults of a new image cost more than the drawing. Small tensors do not use
/// the store. The store keeps at most 256 MB of unused memory. Safe to call from any thread.
torch::Tensor recycled_empty(torch::IntArrayRef sizes, torch::ScalarType dtype);

}  // namespace doppel::render
