#pragma once

#include <torch/types.h>

#include <algorithm>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Faces of a mesh in the form that the rasterizer takes: int32 [F,3].
inline torch::Tensor face_tensor(const TriangleMesh& mesh) {
  torch::Tensor faces = torch::empty({mesh.num_faces(), 3}, torch::kInt32);
  std::int32_t* out = faces.data_ptr<std::int32_t>();
  for (const Triangle& face : mesh.faces) out = std::copy(face.begin(), face.end(), out);
  return faces;
}

}  // namespace doppel
