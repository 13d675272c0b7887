#include "doppel/render/outline/seen_vertices.h"

namespace doppel {

using torch::Tensor;

Tensor seen_vertices(const Tensor& face_id, const Tensor& faces, const Tensor& vertices, const Tensor& eye,
                     double min_facing) {
  const torch::NoGradGuard no_grad;
  const Tensor seen_faces = face_id.masked_select(face_id >= 0).to(torch::kInt64);
  Tensor seen = torch::zeros({vertices.size(0)}, torch::kBool);
  seen.index_fill_(0, faces.index_select(0, seen_faces).flatten(), true);
  const auto corner = [&](int k) { return vertices.index_select(0, faces.select(1, k)); };
  const Tensor face_normal = torch::cross(corner(1) - corner(0), corner(2) - corner(0), 1);
  Tensor normal = torch::zeros_like(vertices);
  for (int k = 0; k < 3; ++k) normal.index_add_(0, faces.select(1, k), face_normal);
  const Tensor look = eye - vertices;
  return seen & ((normal * look).sum(1) > min_facing * normal.norm(2, {1}) * look.norm(2, {1}));
}

}  // namespace doppel
