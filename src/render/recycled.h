#pragma once

#include <torch/types.h>

namespace doppel::render {

/// A tensor with undefined content whose memory goes back to a store when the last reference to it ends, for the next
/// tensor of the same size: the page faults of a fresh image cost more than drawing it. Small ones are ordinary
/// tensors. The store keeps at most 256 MB that nobody uses; safe to call from any thread.
torch::Tensor recycled_empty(torch::IntArrayRef sizes, torch::ScalarType dtype);

}  // namespace doppel::render
