// The texture of a sphere from its images in six cameras.
#include <doppel/render/shading/shading.h>

#include <cstdio>

#include "sphere.h"

constexpr int kSize = 96, kTexels = 32;

int main() {
  const Sphere sphere = make_sphere();
  const torch::Tensor cameras = make_cameras(6, kSize), vertices = sphere.vertices.unsqueeze(0);
  const doppel::RenderMesh mesh(sphere.faces, sphere.corner_uvs, sphere.vertices.size(0));
  doppel::ShadingOptions albedo;
  albedo.lit = false;
  const auto draw = [&](const torch::Tensor& texture) {
    return doppel::shade(vertices, texture, {}, cameras, mesh, kSize, kSize, albedo);
  };
  const torch::Tensor stripes = torch::arange(kTexels).div(4, "floor").remainder(2).to(torch::kFloat32);
  const torch::Tensor ground_truth =
      (0.2 + 0.6 * stripes).view({1, 1, kTexels, 1}).expand({1, kTexels, kTexels, 3}).contiguous();
  const doppel::ShadedImage target = draw(ground_truth);

  const torch::Tensor texture = torch::full({1, kTexels, kTexels, 3}, 0.5f).requires_grad_();
  torch::optim::Adam optimiser({texture}, 0.05);
  double first = 0, last = 0;
  for (int step = 0; step < 60; ++step) {
    optimiser.zero_grad();
    const torch::Tensor loss = (draw(texture).colour - target.colour).square().sum() / target.mask.sum();
    loss.backward();
    optimiser.step();
    last = loss.item<double>();
    if (step == 0) first = last;
  }
  std::printf("squared difference of the images: %.5f at first, %.7f at last\n", first, last);
  return last < 1e-3 * first ? 0 : 1;
}
