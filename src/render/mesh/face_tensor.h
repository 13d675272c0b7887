#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Faces of a mesh in the form that the rasterizer takes: int32 [F,3].
inline torch::Tensor face_tensor(const TriangleMesh& mesh) {
  torch::Tensor faces = torch::empty({mesh.num_faces(), 3}, torch::kInt32);
  std::int32_t* out = faces.data_ptr<std::int32_t>();
  for (const Triangle& face : mesh.faces) out = std::copy(face.begin(), face.end(), out);
  return faces;
}

/// Positions of vertices in the form that the rasterizer takes: float32 [1,N,3].
inline torch::Tensor vertex_tensor(const std::vector<Eigen::Vector3d>& vertices) {
  torch::Tensor tensor = torch::empty({1, static_cast<std::int64_t>(vertices.size()), 3});
  float* out = tensor.data_ptr<float>();
  for (const Eigen::Vector3d& vertex : vertices)
    for (const double x : vertex) *out++ = static_cast<float>(x);
  return tensor;
}

}  // namespace doppel
