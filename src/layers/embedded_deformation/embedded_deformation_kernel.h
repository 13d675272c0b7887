#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// Embedded deformation of up to `lanes` items of the batch at once. Pointers are to the whole batch; `first` and
/// `count` select the items. Positions `rest` and `nodes` are relative to `centre`.
struct DeformationParams {
  int64_t num_vertices, num_nodes;
  const int32_t* offsets;  ///< [N+1] rows of nodes
  const int32_t* items;
  const float* weights;
  const int32_t* transposed_offsets;  ///< [K+1] rows of vertices
  const int32_t* transposed_items;
  const float* transposed_weights;
  const float* rest;    ///< [N,3]
  const float* nodes;   ///< [K,3]
  const float* centre;  ///< [3]

  int64_t first;
  int count, lanes;
  const float* angles;           ///< A [B,K,3]
  const float* translations;     ///< T [B,K,3]
  const float* displacements;    ///< D [B,N,3] or null
  const float* node_transforms;  ///< [B,K,3,4] or null
  float* table;                  ///< [K,12,lanes]: rows of [R - I | T + g - R g], filled by deformation_prepare
  float* pose_table;  ///< [K,12,lanes]: node transforms about centre and origin, filled by deformation_prepare
  float* origin;      ///< [3,lanes], the centre as transformed by the first node

  float* out;             ///< forward: [B,N,3]
  const float* grad_out;  ///< backward
  float* grad_angles;     ///< null when not wanted (together with grad_translations)
  float* grad_translations;
  float* grad_displacements;    ///< null when not wanted or equal to grad_out
  float* grad_node_transforms;  ///< null when not wanted
  // Inputs of the nodes' gradients, [N,3,lanes] each; the last two only with node transforms.
  float* canonical_gradient;  ///< dL/dy
  float* posed_gradient;      ///< dL/dx
  float* canonical;           ///< y relative to the centre
};

namespace kernels {

DOPPEL_DECLARE_KERNEL(int, deformation_lanes, (int64_t count))
DOPPEL_DECLARE_KERNEL(void, deformation_prepare_origin, (const DeformationParams& p))
/// Nodes [begin,end) in the form the vertices read.
DOPPEL_DECLARE_KERNEL(void, deformation_prepare, (const DeformationParams& p, int64_t begin, int64_t end))
/// Vertices [begin,end).
DOPPEL_DECLARE_KERNEL(void, deformation_forward, (const DeformationParams& p, int64_t begin, int64_t end))
/// Vertices [begin,end): the inputs of the nodes' gradients, and grad_displacements.
DOPPEL_DECLARE_KERNEL(void, deformation_backward_vertices, (const DeformationParams& p, int64_t begin, int64_t end))
/// Nodes [begin,end): grad_angles, grad_translations, grad_node_transforms.
DOPPEL_DECLARE_KERNEL(void, deformation_backward_nodes, (const DeformationParams& p, int64_t begin, int64_t end))

}  // namespace kernels
}  // namespace doppel
