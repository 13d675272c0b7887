#include "doppel/render/mesh/render_mesh.h"

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/face_table.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr std::size_t kMaxTexels = std::size_t{1} << 26;  // 8192 x 8192: 0.8 GB as floats

Tensor corner_uvs_of(const TriangleMesh& mesh) {
  if (mesh.face_uvs.empty()) return {};
  if (mesh.face_uvs.size() != mesh.faces.size()) {
    fail<UsageError>("RenderMesh: {} of {} faces have UVs; give UVs to all or to none", mesh.face_uvs.size(),
                     mesh.faces.size());
  }
  Tensor uvs = torch::empty({mesh.num_faces(), 3, 2}, torch::kFloat32);
  float* out = uvs.data_ptr<float>();
  for (std::size_t f = 0; f < mesh.face_uvs.size(); ++f) {
    for (const int index : mesh.face_uvs[f]) {
      if (index < 0 || index >= static_cast<int>(mesh.uvs.size())) {
        fail<UsageError>("RenderMesh: face {} names UV {}, and there are {}", f, index, mesh.uvs.size());
      }
      const Eigen::Vector2d& uv = mesh.uvs[index];
      *out++ = static_cast<float>(uv.x());
      *out++ = static_cast<float>(uv.y());
    }
  }
  return uvs;
}

}  // namespace

RenderMesh::RenderMesh(const TriangleMesh& mesh)
    : RenderMesh(face_tensor(mesh), corner_uvs_of(mesh), mesh.num_vertices()) {}

RenderMesh::RenderMesh(const Tensor& faces_in, const Tensor& corner_uvs_in, std::int64_t vertices)
    : num_vertices(vertices) {
  const render::FaceTable table = render::make_face_table(faces_in, "RenderMesh");
  render::check_corners("RenderMesh", table, num_vertices);
  faces = faces_in.to(torch::kInt32).contiguous().clone();
  const std::int64_t num_faces = table.num_faces;
  face_records = torch::empty({num_faces, 4}, torch::kInt32);
  std::copy(table.corners.begin(), table.corners.end(), face_records.data_ptr<std::int32_t>());
  if (corner_uvs_in.defined()) {
    check_floats("RenderMesh", "corner_uvs", corner_uvs_in, {num_faces, 3, 2});
    corner_uvs = corner_uvs_in.contiguous().clone();
    uv_records = torch::constant_pad_nd(corner_uvs.reshape({num_faces, 6}), {0, 2}).contiguous();
  }

  incident_offsets = torch::zeros({num_vertices + 1}, torch::kInt32);
  incident_faces = torch::empty({3 * num_faces}, torch::kInt32);
  std::int32_t* offsets = incident_offsets.data_ptr<std::int32_t>();
  const std::int32_t* corner = faces.data_ptr<std::int32_t>();
  for (std::int64_t i = 0; i < 3 * num_faces; ++i) ++offsets[corner[i] + 1];
  for (std::int64_t i = 0; i < num_vertices; ++i) offsets[i + 1] += offsets[i];
  std::vector<std::int32_t> next(offsets, offsets + num_vertices);
  std::int32_t* items = incident_faces.data_ptr<std::int32_t>();
  for (std::int64_t i = 0; i < 3 * num_faces; ++i) {
    items[next[corner[i]]++] = static_cast<std::int32_t>(i / 3);
  }
}

Tensor texture_tensor(const TriangleMesh& mesh) {
  if (mesh.texture.empty() || mesh.texture.type() != CV_8UC3) {
    fail<UsageError>("texture_tensor: the mesh has {}; it needs an 8-bit image of three channels",
                     mesh.texture.empty() ? "no texture" : "a texture of another type");
  }
  cv::Mat texture = mesh.texture;
  while (texture.total() > kMaxTexels) cv::resize(texture, texture, {}, 0.5, 0.5, cv::INTER_AREA);
  if (texture.total() < mesh.texture.total())
    log::info("the texture of {} x {} texels is drawn with {} x {}", mesh.texture.cols, mesh.texture.rows, texture.cols,
              texture.rows);
  return tensor_of(texture).unsqueeze(0);
}

Tensor vertex_normal_sums(const Tensor& vertices, const RenderMesh& mesh) {
  check_shape("vertex_normal_sums", "vertices", vertices, {-1, mesh.num_vertices, 3}, "[B,N,3]");
  const Tensor corner = mesh.faces.to(torch::kInt64).t().contiguous();  // [3,F]
  const Tensor a = vertices.index_select(1, corner[0]), b = vertices.index_select(1, corner[1]),
               c = vertices.index_select(1, corner[2]);
  const Tensor normal = torch::cross(b - a, c - a, 2);
  Tensor sums = torch::zeros_like(vertices);
  for (int k = 0; k < 3; ++k) sums = sums.index_add(1, corner[k], normal);
  return sums;
}

}  // namespace doppel
