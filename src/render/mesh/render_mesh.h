#pragma once

#include <torch/types.h>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// A mesh without its positions, in the form of the renderer. Immutable; copies share memory.
struct RenderMesh {
  torch::Tensor faces;             ///< int32 [F,3]
  torch::Tensor corner_uvs;        ///< float32 [F,3,2] u right, v up; undefined without UVs
  torch::Tensor incident_offsets;  ///< int32 [N+1]: the faces at vertex i are rows offsets[i] .. offsets[i+1] of
  torch::Tensor incident_faces;    ///< int32 [3F], ascending per vertex
  torch::Tensor face_records;      ///< int32 [F,4]: `faces` as the kernels read them, the fourth unused
  torch::Tensor uv_records;        ///< float32 [F,8]: `corner_uvs` as the kernels read them; undefined without UVs
  std::int64_t num_vertices = 0;

  /// @throws Error when a face names a vertex or a UV that does not exist, or only some faces have UVs
  explicit RenderMesh(const TriangleMesh& mesh);
  /// @param faces int32 or int64 [F,3]; @param corner_uvs float32 [F,3,2], or undefined
  RenderMesh(const torch::Tensor& faces, const torch::Tensor& corner_uvs, std::int64_t num_vertices);

  bool has_uvs() const { return corner_uvs.defined(); }
  std::int64_t num_faces() const { return faces.size(0); }
};

/// The texture of a mesh, for drawing. A texture of more than 2^26 texels (8192 x 8192) is halved until it has fewer.
/// @return float32 [1,Th,Tw,3], RGB 0..1, row 0 at v = 1
/// @throws Error when the mesh has none
torch::Tensor texture_tensor(const TriangleMesh& mesh);

/// Area-weighted vertex normals, NOT of unit length: the sum of the cross products of the faces at a vertex (twice
/// their areas, square metres). Plain tensor operations, differentiable, any dtype; traceable.
/// @param vertices [B,N,3] @return [B,N,3]
torch::Tensor vertex_normal_sums(const torch::Tensor& vertices, const RenderMesh& mesh);

}  // namespace doppel
