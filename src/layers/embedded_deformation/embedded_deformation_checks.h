#pragma once

#include "doppel/core/tensor/checks.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"

namespace doppel {

/// The argument checks that reference and op share.
inline void check_deformation_arguments(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                        const torch::Tensor& node_transforms, const DeformationGraph& graph) {
  const char* op = "embedded_deformation";
  const int64_t K = graph.weights.num_columns, N = graph.weights.num_rows;
  check_shape(op, "A", A, {-1, K, 3}, "[B,K,3]");
  const int64_t B = A.size(0);
  check_shape(op, "T", T, {B, K, 3}, "[B,K,3]");
  check_same_kind(op, "T", T, A);
  if (D.defined()) {
    check_shape(op, "D", D, {B, N, 3}, "[B,N,3]");
    check_same_kind(op, "D", D, A);
  }
  if (node_transforms.defined()) {
    check_shape(op, "node_transforms", node_transforms, {B, K, 3, 4}, "[B,K,3,4]");
    check_same_kind(op, "node_transforms", node_transforms, A);
  }
}

}  // namespace doppel
