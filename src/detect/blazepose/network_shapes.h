#pragma once

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// Checks that each operator finds the inputs that it needs, computed before or constant, and that its output has the
/// shape that follows from them.
/// @throws FileError naming the operator, its number and its output
void check_shapes(const NetworkModel& model);

/// Zeros that "same" padding puts before the first and after the last pixel of one axis.
struct SamePadding {
  std::int64_t before = 0, after = 0;
};
SamePadding same_padding(std::int64_t size, std::int64_t window, std::int64_t stride);

}  // namespace doppel
