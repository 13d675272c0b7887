#pragma once

#include <torch/types.h>

#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/texture/texture_space.h"

namespace doppel {

/// Coordinate frames of surface points. They move Gaussians with a mesh.
struct SurfaceFrames {
  torch::Tensor positions;  ///< [B,P,3] world, metres
  /// [B,P,4] unit quaternions w x y z: from the frame (tangent, bitangent, normal) to the world
  torch::Tensor rotations;
  torch::Tensor normals;  ///< [B,P,3] unit
};
/// The normal is interpolated from the area-weighted vertex normals. The tangent is the first edge of the point's face,
/// made orthogonal to the normal. Plain tensor operations. Where a face has no area, the rotation is
/// arbitrary.
/// @param vertices [B,N,3] world, metres
SurfaceFrames surface_frames(const torch::Tensor& vertices, const RenderMesh& mesh, const TexelPoints& points);
/// The same where the result of `vertex_normal_sums` is at hand. @param normal_sums [B,N,3]
SurfaceFrames surface_frames(const torch::Tensor& vertices, const torch::Tensor& normal_sums,
                             const TexelPoints& points);

/// Vectors of length 1; those shorter than 1e-12 become shorter than 1. @param vectors [...,K]
torch::Tensor unit_vectors(const torch::Tensor& vectors);
/// Values of the vertices at surface points, by barycentrics. @param values [B,N,K] @return [B,P,K]
torch::Tensor at_points(const torch::Tensor& values, const TexelPoints& points);

/// Products of quaternions w x y z. @param a, b [...,4] @return [...,4] a b: first b, then a
torch::Tensor quaternion_product(const torch::Tensor& a, const torch::Tensor& b);
/// Vectors turned by unit quaternions w x y z. @param rotations [...,4] @param vectors [...,3]
torch::Tensor turned(const torch::Tensor& rotations, const torch::Tensor& vectors);

}  // namespace doppel
