#pragma once

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// The same network with fewer passes over memory: a pad of rows and columns that only one convolution reads becomes
/// part of this convolution, which then has `pad_before` and `pad_after`.
/// @param model for which `check_shapes` holds; it holds for the result, too
NetworkModel fold_padding(const NetworkModel& model);

/// The network with some of its outputs, in another order, without the operators that only the others need.
/// @param outputs indices into `model.outputs`
NetworkModel keep_outputs(const NetworkModel& model, const std::vector<std::size_t>& outputs);

}  // namespace doppel
