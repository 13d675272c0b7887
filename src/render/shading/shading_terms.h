#pragma once

#include <torch/types.h>

#include <array>
#include <vector>

#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/shading/shading_types.h"

/// Kernel and reference of `shade` and `target_on_surface`, with checked arguments.
namespace doppel::shading {

/// Quantities derived from a projection matrix P = [M | p].
struct ViewGeometry {
  std::array<float, 9> ray{};     ///< M^-1: pixel (u, v, 1) to the direction of its ray, away from the camera
  std::array<float, 3> centre{};  ///< -M^-1 p
};

/// float64 [B,C,3,3] M^-1 and [B,C,3] centres. Both are 0 for a view whose matrix is all 0; it draws nothing.
/// @throws Error for a matrix without a centre (an affine camera) or with NaN
struct ViewTensors {
  torch::Tensor ray, centre;
};
ViewTensors view_tensors(const char* op, const torch::Tensor& projection);
std::vector<ViewGeometry> view_geometry(const ViewTensors& views);

/// A texture with at least two texels along each side. A single row or column is repeated, which does not change the
/// image.
torch::Tensor at_least_two_texels(const torch::Tensor& texture);

/// Cosine between ray and face below which no gradient passes through barycentrics.
constexpr double kGrazing = 0.001;
/// Squared length below which a normal counts as undefined.
constexpr double kTinyNormal = 1e-30;

ShadedImage reference(const torch::Tensor& vertices, const torch::Tensor& texture, const torch::Tensor& lighting,
                      const torch::Tensor& projection, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                      const ShadingOptions& options);
ShadedImage fused(const torch::Tensor& vertices, const torch::Tensor& texture, const torch::Tensor& lighting,
                  const torch::Tensor& projection, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                  const ShadingOptions& options);
/// @param projection of the samples; height and width count samples, multiples of `factor`
SupersampledImage fused_supersampled(const torch::Tensor& vertices, const torch::Tensor& texture,
                                     const torch::Tensor& lighting, const torch::Tensor& projection,
                                     const RenderMesh& mesh, std::int64_t height, std::int64_t width, int factor,
                                     const ShadingOptions& options);

torch::Tensor target_reference(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                               const torch::Tensor& target, const TargetOptions& options);
torch::Tensor target_fused(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                           const torch::Tensor& target, const TargetOptions& options, const Fragments& fragments);

}  // namespace doppel::shading
