#pragma once

#include <torch/types.h>

#include <vector>

#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/raster/rasterizer.h"
#include "render/scenes.h"

/// Textured, lit scenes for the tests of the renderer. Everything float64; convert what goes into kernels.
namespace doppel::test {

/// A dented sphere with UVs from its front view, so that front and back share the texture.
inline RenderMesh with_front_uvs(const Mesh& mesh, double scale) {
  const torch::Tensor uv = mesh.vertices.slice(1, 0, 2) * scale + 0.5;
  return RenderMesh(mesh.faces, uv.index_select(0, mesh.faces.to(torch::kInt64).flatten()).reshape({-1, 3, 2}),
                    mesh.vertices.size(0));
}

struct ShadingScene {
  torch::Tensor vertices;    ///< [B,N,3]
  torch::Tensor texture;     ///< [1,Th,Tw,3]
  torch::Tensor lighting;    ///< [B,C,3,9]
  torch::Tensor projection;  ///< [B,C,3,4], the second camera with skew and an off-centre principal point
  RenderMesh mesh;
  std::int64_t height, width;

  ShadingScene to(torch::ScalarType type) const {
    return {vertices.to(type), texture.to(type), lighting.to(type), projection.to(type), mesh, height, width};
  }
};

inline torch::Tensor skewed(const torch::Tensor& projection) {
  const torch::Tensor change = torch::tensor({1.0, 0.15, -4.0, 0.0, 1.1, 3.5, 0.0, 0.0, 1.0}, torch::kFloat64);
  return torch::matmul(change.reshape({3, 3}), projection);
}

inline ShadingScene shading_scene(std::int64_t batch, std::int64_t cameras, std::int64_t height, std::int64_t width,
                                  int rings = 7) {
  auto generator = at::detail::createCPUGenerator(5);
  const Mesh ball = sphere(rings, 0.5f);
  const auto doubles = torch::TensorOptions(torch::kFloat64);
  std::vector<torch::Tensor> items, views;
  for (std::int64_t b = 0; b < batch; ++b) {
    items.push_back(ball.vertices.to(torch::kFloat64) * (1.0 + 0.1 * static_cast<double>(b)) +
                    0.02 * torch::randn(ball.vertices.sizes(), generator, doubles));
  }
  for (std::int64_t c = 0; c < cameras; ++c) {
    const torch::Tensor p = orbit_projection(0.3 + 1.1 * static_cast<double>(c), 2.5, 1.9 * static_cast<double>(width),
                                             static_cast<double>(width));
    views.push_back(c == 1 ? skewed(p) : p);
  }
  const torch::Tensor one = cameras > 0 ? torch::stack(views) : torch::empty({0, 3, 4}, doubles);
  return {batch > 0 ? torch::stack(items) : torch::empty({0, ball.vertices.size(0), 3}, doubles),
          torch::rand({1, 9, 13, 3}, generator, doubles),
          0.4 * torch::randn({batch, cameras, 3, 9}, generator, doubles),
          one.unsqueeze(0).expand({batch, cameras, 3, 4}).contiguous(),
          with_front_uvs(ball, 0.7),
          height,
          width};
}

/// 1 where a pixel lies at least `margin` (barycentric) inside its face, else 0. @return float64 [B,C,H,W,1]
inline torch::Tensor inner_pixels(const ShadingScene& s, double margin) {
  Rasterizer rasterizer(s.mesh.faces);
  const RasterImage& image = rasterizer.rasterize_projected(s.vertices.to(torch::kFloat32),
                                                            s.projection.to(torch::kFloat32), s.height, s.width);
  return (image.barycentrics.amin(3) > margin)
      .to(torch::kFloat64)
      .reshape({s.vertices.size(0), s.projection.size(1), s.height, s.width, 1});
}

}  // namespace doppel::test
