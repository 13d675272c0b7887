#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

#pragma once

namespace doppel {

/// Fails unless every number is finite: the distance from a point that is not finite is undefined.
inline void check_finite(const char* argument, const torch::Tensor& tensor) {
  if (!tensor.isfinite().all().item<bool>())
    fail<UsageError>("closest_point: {} has numbers that are not finite; check how they were computed", argument);
}

/// The argument checks that reference and kernel share.
inline void check_closest_point_arguments(const torch::Tensor& vertices, const torch::Tensor& points,
                                          int64_t num_vertices) {
  check_shape("closest_point", "vertices", vertices, {-1, num_vertices, 3}, "[B,N,3]");
  check_shape("closest_point", "points", points, {vertices.size(0), -1, 3}, "[B,P,3]");
  check_same_kind("closest_point", "points", points, vertices);
  check_finite("vertices", vertices);
  check_finite("points", points);
}

}  // namespace doppel
