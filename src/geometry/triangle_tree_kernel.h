#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// Boxes and triangles that are compared at once.
constexpr int kTreeWidth = 8;

/// The boxes of up to kTreeWidth children. Unused lanes have a box without points (low = inf, high = -inf).
struct alignas(64) TreeNode {
  double low[3][kTreeWidth], high[3][kTreeWidth];  ///< by axis
  std::int32_t child[kTreeWidth];                  ///< a node, or ~leaf
};

/// Up to kTreeWidth triangles. Unused lanes repeat the first.
struct alignas(64) TreeLeaf {
  double corner[3][3][kTreeWidth];  ///< by corner and axis
  std::int32_t face[kTreeWidth];
};

namespace kernels {

/// The children whose boxes are not farther than `bound`, one bit each. @param point [3]
/// @param distance [kTreeWidth] squared distances to the boxes
DOPPEL_DECLARE_KERNEL(unsigned, near_children,
                      (const TreeNode& node, const double* point, double bound, double* distance))
/// The triangles that may be within `bound`, a squared distance, one bit each. Rounding differs from that of
/// closest_on_triangle, so `bound` needs a margin.
DOPPEL_DECLARE_KERNEL(unsigned, near_triangles, (const TreeLeaf& leaf, const double* point, double bound))

}  // namespace kernels
}  // namespace doppel
