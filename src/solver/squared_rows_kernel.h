#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

/// The number of columns below is a multiple of this number.
constexpr int64_t kPanelStep = 8;

/// Adds J^T J to `sum`. Only the part of `sum` on and right of the diagonal is defined.
/// @param rows [num_rows,columns] @param columns multiple of kPanelStep @param sum [columns,columns] row-major
DOPPEL_DECLARE_KERNEL(void, add_squared_rows, (const double* rows, int64_t num_rows, int64_t columns, double* sum))

}  // namespace doppel::kernels
