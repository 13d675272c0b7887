#pragma once

#include "doppel/core/tensor/checks.h"
#include "doppel/layers/global_alignment/global_alignment.h"

namespace doppel {

/// Checks the shapes of all arguments, for both the reference and the op.
inline void check_alignment_arguments(const torch::Tensor& points, const LandmarkRays& rays,
                                      const torch::Tensor& prior) {
  constexpr const char* kName = "global_alignment";
  check_shape(kName, "points", points, {-1, -1, 3}, "[B,M,3]");
  const int64_t B = points.size(0), M = points.size(1);
  check_shape(kName, "rays.origin", rays.origin, {B, -1, 3}, "[B,C,3]");
  const int64_t C = rays.origin.size(1);
  check_shape(kName, "rays.direction", rays.direction, {B, C, M, 3}, "[B,C,M,3]");
  check_shape(kName, "rays.confidence", rays.confidence, {B, C, M}, "[B,C,M]");
  if (prior.defined()) check_shape(kName, "prior", prior, {B, 3}, "[B,3]");
}

}  // namespace doppel
