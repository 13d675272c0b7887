// The radius of a sphere from its silhouettes in three cameras.
#include <doppel/detect/masks/mask.h>
#include <doppel/losses/silhouette.h>
#include <doppel/render/raster/rasterizer.h>

#include <cstdio>
#include <opencv2/core.hpp>

#include "sphere.h"

constexpr int kSize = 128;
constexpr double kTrue = 0.8;

/// Distance fields and contours of masks uint8 [1,C,S,S].
doppel::SilhouetteTarget target_of(const torch::Tensor& masks, const torch::Tensor& cameras) {
  doppel::SilhouetteTarget target;
  target.projection = cameras;
  target.distance = torch::zeros(masks.sizes());
  target.valid = torch::ones({1, masks.size(1)}, torch::kBool);
  std::vector<float> contour;
  std::vector<std::int64_t> offsets{0};
  for (int c = 0; c < masks.size(1); ++c) {
    const torch::Tensor bytes = masks[0][c].mul(255).contiguous();
    const cv::Mat mask(kSize, kSize, CV_8U, bytes.data_ptr());
    cv::Mat distance(kSize, kSize, CV_32F, target.distance[0][c].data_ptr());
    doppel::signed_distance(mask).copyTo(distance);
    for (const doppel::ContourPixel& pixel : doppel::contour_pixels(mask)) {
      contour.push_back(static_cast<float>(pixel.x) + 0.5f);
      contour.push_back(static_cast<float>(pixel.y) + 0.5f);
    }
    offsets.push_back(static_cast<std::int64_t>(contour.size() / 2));
  }
  target.contour = torch::tensor(contour).view({-1, 2});
  target.contour_offsets = torch::tensor(offsets);
  return target;
}

int main() {
  const Sphere sphere = make_sphere();
  const torch::Tensor cameras = make_cameras(3, kSize), vertices = sphere.vertices.unsqueeze(0);
  const torch::Tensor masks =
      doppel::Rasterizer(sphere.faces).coverage_projected(kTrue * vertices, cameras, kSize, kSize);
  const doppel::SilhouetteTarget target = target_of(masks, cameras);
  const torch::Tensor radius = torch::ones({}).requires_grad_();
  torch::optim::Adam optimiser({radius}, 0.02);
  for (int step = 0; step < 80; ++step) {
    optimiser.zero_grad();
    const doppel::SilhouetteLoss loss = doppel::silhouette_loss(radius * vertices, sphere.faces, target);
    (loss.model_to_data + loss.data_to_model).backward();
    optimiser.step();
  }
  std::printf("radius %.3f, the true one is %.3f\n", radius.item<double>(), kTrue);
  return std::abs(radius.item<double>() - kTrue) < 0.03 ? 0 : 1;
}
