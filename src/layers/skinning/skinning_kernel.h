#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// Skinning of up to `lanes` items of the batch at once. Pointers are to the whole batch; `first` and `count` select
/// the items.
struct SkinningParams {
  int64_t num_points, num_bones;
  const int32_t* offsets;  ///< [N+1] rows of influences
  const int32_t* items;
  const float* weights;
  bool linear;
  bool blend_only;  ///< the output is the blended transforms [B,N,3,4] instead of points

  int64_t first;
  int count, lanes;
  const float* bones;   ///< [B,Bn,3,4]
  const float* points;  ///< [B,N,3], or [N,3] with point_stride 0; null when blend_only
  int64_t point_stride;
  float* table;  ///< [Bn, 8 (dual quaternion) or 12 (linear), lanes], filled by skinning_prepare
  float* frame;  ///< [6, lanes]: the points' local centre, the posed origin; filled by skinning_prepare_frame

  float* out;             ///< forward: [B,N,3] or [B,N,3,4]
  const float* grad_out;  ///< backward, likewise
  float* grad_points;     ///< [B,N,3], or [N,3] to be added to; null when not wanted
  float* grad_bones;      ///< [B,Bn,3,4]; null when not wanted
  float* grad_tables;     ///< [parts, Bn, 8 or 12, lanes], zero on entry
  int64_t num_parts;
};

namespace kernels {

/// The number of lanes of a chunk of `count` items (4, 8 or 16).
DOPPEL_DECLARE_KERNEL(int, skinning_lanes, (int64_t count))
/// The centre and origin of each item, then its bones in the form the vertices read; bones [begin,end).
DOPPEL_DECLARE_KERNEL(void, skinning_prepare_frame, (const SkinningParams& p))
DOPPEL_DECLARE_KERNEL(void, skinning_prepare, (const SkinningParams& p, int64_t begin, int64_t end))
/// Points [begin,end).
DOPPEL_DECLARE_KERNEL(void, skinning_forward, (const SkinningParams& p, int64_t begin, int64_t end))
/// Points [begin,end). The gradient to the bones goes into grad_tables[part].
DOPPEL_DECLARE_KERNEL(void, skinning_backward, (const SkinningParams& p, int64_t begin, int64_t end, int64_t part))
/// grad_bones of bones [begin,end) from the parts, summed in their order.
DOPPEL_DECLARE_KERNEL(void, skinning_finish, (const SkinningParams& p, int64_t begin, int64_t end))

}  // namespace kernels
}  // namespace doppel
