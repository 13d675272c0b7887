#pragma once

#include <torch/types.h>

#include <vector>

#include "doppel/render/mesh/render_mesh.h"

namespace doppel {

/// Surface points at the centres of texels.
struct TexelPoints {
  torch::Tensor texel;    ///< int64 [P] row * T + column, ascending
  torch::Tensor corners;  ///< int64 [P,3] vertices
  torch::Tensor weights;  ///< float32 [P,3] barycentrics
};

/// Draws properties of the surface into the texture map. The face of each texel is computed once. A map is then an
/// index and a weighted sum in plain tensor operations: differentiable, traceable, any dtype.
///
/// A texel belongs to the face whose UV triangle contains the texel's centre, to the lowest if there are several.
/// Texels up to `padding` away from a chart repeat the nearest texel of the chart, so that bilinear look-ups at the
/// edge of a chart use only values of that chart.
class TextureSpace {
 public:
  /// @param size of the square map, texels, 1 to 16384
  /// @throws Error when the mesh has no UVs
  TextureSpace(const TriangleMesh& mesh, int size, int padding = 3);
  TextureSpace(const RenderMesh& mesh, int size, int padding = 3);

  /// Unit normals in world axes, 0 where there is neither face nor padding. @param vertices [B,N,3] @return [B,3,T,T]
  torch::Tensor normals(const torch::Tensor& vertices) const;
  /// The same by a kernel, several times faster: float32 on the CPU, without gradient.
  torch::Tensor normals_without_gradient(const torch::Tensor& vertices) const;
  /// Positions, world, metres. @param vertices [B,N,3] @return [B,3,T,T]
  torch::Tensor positions(const torch::Tensor& vertices) const;

  /// The texels with a face of their own, padding not counted.
  TexelPoints points() const;
  /// bool [T,T]: texels with a face of their own, padding not counted
  const torch::Tensor& mask() const { return mask_; }
  int size() const { return size_; }

 private:
  void assign_texels(int padding);
  void find_runs();
  torch::Tensor interpolate(const torch::Tensor& values) const;
  torch::Tensor to_map(const torch::Tensor& texels) const;

  RenderMesh mesh_;
  int size_;
  torch::Tensor mask_;
  torch::Tensor lookup_;             ///< int64 [T*T], index among the P texels with a value; P: none
  torch::Tensor corners_;            ///< int64 [3,P] vertices
  torch::Tensor weights_;            ///< float64 [3,P,1] barycentrics
  std::vector<torch::Tensor> runs_;  ///< kernels::TexelTable: runs, corners, weights
};

}  // namespace doppel
