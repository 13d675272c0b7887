// The silhouette loss, value and gradient: fused kernel against the plain tensor operations.
//   silhouette_bench [threads=2]

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include <cmath>
#include <cstdlib>

#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/silhouette.h"
#include "doppel/render/outline/boundary.h"
#include "render/bench_mesh.h"
#include "support/ratio.h"

namespace {

using namespace doppel;
using namespace doppel::bench;
using torch::Tensor;

constexpr int kSize = 350, kBatch = 8, kCameras = 8;

/// Distance to a circle, which is all that the time depends on, with a contour of one pixel per pixel of arc.
SilhouetteTarget circle_target() {
  SilhouetteTarget target;
  std::vector<Tensor> cameras;
  for (int k = 0; k < kCameras; ++k) {
    const double angle = k * M_PI / 4, s = std::sin(angle), c = std::cos(angle), f = 1.8 * kSize, h = kSize / 2.0;
    cameras.push_back(
        torch::tensor({-c * f - s * h, 0.0, -s * f + c * h, 4 * h, -s * h, -f, c * h, 4 * h, -s, 0.0, c, 4.0})
            .reshape({3, 4}));
  }
  target.projection = torch::stack(cameras).to(torch::kFloat32).expand({kBatch, kCameras, 3, 4}).contiguous();
  const double radius = 0.36 * kSize;
  const Tensor x = torch::arange(kSize, torch::kFloat32) + 0.5f - kSize / 2.0f;
  target.distance = (torch::sqrt(x.square().unsqueeze(0) + x.square().unsqueeze(1)) - radius)
                        .expand({kBatch, kCameras, kSize, kSize})
                        .contiguous();
  target.valid = torch::ones({kBatch, kCameras}, torch::kBool);
  const int pixels = static_cast<int>(2 * M_PI * radius);
  const Tensor angle = torch::arange(pixels, torch::kFloat32) * static_cast<float>(2 * M_PI / pixels);
  const Tensor circle = (torch::stack({torch::cos(angle), torch::sin(angle)}, 1) * radius + kSize / 2.0).floor() + 0.5;
  target.contour = circle.repeat({kBatch * kCameras, 1});
  target.contour_offsets = torch::arange(kBatch * kCameras + 1, torch::kInt64) * pixels;
  return target;
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const BenchMesh mesh = bench_mesh();
  const SilhouetteTarget target = circle_target();
  const Tensor vertices = mesh.vertices.unsqueeze(0).repeat({kBatch, 1, 1}).requires_grad_();
  const Tensor boundary = boundary_vertices(vertices, target.projection, mesh.faces, kSize, kSize);
  const auto step = [&] {
    const Tensor loss = silhouette_loss(vertices, mesh.faces, boundary, target).total();
    torch::autograd::grad({loss}, {vertices});
  };
  compare(
      "silhouette loss, forward + backward, 8 x 8 cameras of 350^2",
      {{"boundary vertices alone", [&] { boundary_vertices(vertices, target.projection, mesh.faces, kSize, kSize); }},
       {"reference",
        [&] {
          const ReferenceScope reference;
          step();
        }},
       {"kernel", step}},
      {1, 11, 2.0});
}
