#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// A kinematic chain and the frames fixed to it, as pointers (documented in kinematics.h).
struct KinematicsParams {
  int64_t num_joints, num_dofs, num_frames;
  const int32_t* parent;
  const int32_t* prismatic;
  const double* geometry;
  const int32_t* drive_offsets;
  const int32_t* drive_dof;
  const double* drive_weight;
  const int32_t* frame_joint;
  const double* frame_local;
  const float* dofs;         ///< [B,D]
  float* frames;             ///< [B,M,3,4], forward only
  const float* grad_frames;  ///< [B,M,3,4], backward only
  float* grad_dofs;          ///< [B,D], backward only
};

namespace kernels {

/// Items [begin,end) of the batch. @param scratch 12 J doubles (forward), 24 J + D (backward)
DOPPEL_DECLARE_KERNEL(void, kinematics_forward,
                      (const KinematicsParams& p, int64_t begin, int64_t end, double* scratch))
DOPPEL_DECLARE_KERNEL(void, kinematics_backward,
                      (const KinematicsParams& p, int64_t begin, int64_t end, double* scratch))

}  // namespace kernels
}  // namespace doppel
