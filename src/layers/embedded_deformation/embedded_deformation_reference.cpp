#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/embedded_deformation/embedded_deformation_checks.h"
#include "doppel/layers/rotation_math.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

torch::Tensor euler_to_matrix(const torch::Tensor& angles) {
  if (!angles.defined() || !angles.is_floating_point() || angles.dim() < 1 || angles.size(-1) != 3) {
    fail<UsageError>("euler_to_matrix: angles must be a floating-point tensor [...,3], found {}", describe(angles));
  }
  const torch::Tensor sine = angles.sin(), cosine = angles.cos();
  const torch::Tensor sx = sine.select(-1, 0), sy = sine.select(-1, 1), sz = sine.select(-1, 2);
  const torch::Tensor cx = cosine.select(-1, 0), cy = cosine.select(-1, 1), cz = cosine.select(-1, 2);
  return torch::stack({torch::stack({cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx}, -1),
                       torch::stack({sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx}, -1),
                       torch::stack({-sy, cy * sx, cy * cx}, -1)},
                      -2);
}

torch::Tensor matrix_to_euler(const torch::Tensor& rotation) {
  return rotation_to_angles(rotation, {2, 1, 0}).flip(-1);
}

torch::Tensor embedded_deformation_reference(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                             const torch::Tensor& node_transforms, const DeformationGraph& graph) {
  check_deformation_arguments(A, T, D, node_transforms, graph);
  const torch::Tensor nodes = constant_like(graph.nodes, A), rest = constant_like(graph.rest, A);
  const torch::Tensor rotation = euler_to_matrix(A);
  const torch::Tensor rotated_nodes = torch::matmul(rotation, nodes.unsqueeze(-1)).squeeze(-1);
  torch::Tensor points =
      transform_points(blend_transforms(make_transform(rotation, nodes + T - rotated_nodes), graph.weights), rest);
  if (D.defined()) points = points + D;
  if (node_transforms.defined()) points = transform_points(blend_transforms(node_transforms, graph.weights), points);
  return points;
}

}  // namespace doppel
