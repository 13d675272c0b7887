#pragma once

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// Checks that each operator finds the inputs that it needs, computed before or constant, and that its output has the
/// shape that follows from them.
/// @throws FileError naming the operator, its number and its output
void check_shapes(const NetworkModel& model);

/// Checks that the inputs, followed by the outputs, have these shapes.
/// @param network what was expected, for the message: "the network of hands"
/// @return the model @throws FileError when they have not
const NetworkModel& require_tensors(const NetworkModel& model, const std::vector<TensorShape>& expected,
                                    const char* network);

/// Zeros that "same" padding puts before the first and after the last pixel of one axis.
struct SamePadding {
  std::int64_t before = 0, after = 0;
};
SamePadding same_padding(std::int64_t size, std::int64_t window, std::int64_t stride);

}  // namespace doppel
