// The shading of one view, value and gradient: kernel against plain tensor operations, and against drawing alone.
//   shading_bench [threads=2] [pixels=512]

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdlib>

#include "doppel/core/process.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/shading/shading.h"
#include "render/bench_mesh.h"
#include "support/ratio.h"

namespace {

using namespace doppel;
using namespace doppel::bench;
using torch::Tensor;

/// Forward and backward of one view; gradients to what requires one.
struct Step {
  const RenderMesh& mesh;
  Tensor vertices, texture, lighting, projection, upstream;
  ShadingOptions options;

  void operator()() const {
    const std::int64_t size = upstream.size(2);
    const Tensor colour = shade(vertices, texture, lighting, projection, mesh, size, size, options).colour;
    std::vector<Tensor> inputs;
    for (const Tensor& t : {vertices, texture, lighting}) {
      if (t.defined() && t.requires_grad()) inputs.push_back(t);
    }
    torch::autograd::grad({colour}, inputs, {upstream});
  }
};

}  // namespace

int main(int argc, char** argv) {
  doppel::setup_process();
  const int threads = argc > 1 ? std::atoi(argv[1]) : 2, size = argc > 2 ? std::atoi(argv[2]) : 512;
  at::set_num_threads(threads);
  const BenchMesh mesh = bench_mesh();
  const RenderMesh render_mesh(mesh.faces, mesh.corner_uvs, mesh.vertices.size(0));
  const Tensor view = bench_views(mesh, 1);
  const auto f = static_cast<float>(1.8 * size), c = static_cast<float>(size) / 2;
  const Tensor intrinsics = torch::tensor({f, f, c, c}).unsqueeze(0);
  const Tensor projection = torch::tensor({f, 0.f, c, 0.f, 0.f, f, c, 0.f, 0.f, 0.f, 1.f, 0.f}).reshape({1, 1, 3, 4});
  const Tensor vertices = view.clone().requires_grad_(), texture = torch::rand({1, 1024, 1024, 3});
  const Tensor lighting = torch::randn({1, 1, 3, 9}).requires_grad_(), upstream = torch::randn({1, 1, size, size, 3});
  std::printf("%s: %ld faces, %d x %d pixels, %d threads\n", mesh.name.c_str(), static_cast<long>(mesh.faces.size(0)),
              size, size, threads);

  Rasterizer rasterizer(mesh.faces);
  const auto bare = [&] { rasterizer.rasterize(view, intrinsics, size, size); };
  ShadingOptions lit, unlit, plain;
  unlit.lit = false;
  plain.use_reference = true;
  const Tensor painted = texture.clone().requires_grad_(), fixed = view;
  const Step shading{render_mesh, vertices, texture, lighting, projection, upstream, lit};
  const Step reference{render_mesh, vertices, texture, lighting, projection, upstream, plain};
  const Step textured{render_mesh, vertices, texture, {}, projection, upstream, unlit};
  const Step to_texture{render_mesh, fixed, painted, {}, projection, upstream, unlit};
  const auto forward = [&] {
    const torch::NoGradGuard no_gradient;
    shade(vertices, texture, lighting, projection, render_mesh, size, size, lit);
  };
  const std::int64_t covered =
      (rasterizer.rasterize(view, intrinsics, size, size).face_id >= 0).sum().item<std::int64_t>();
  std::printf("%ld pixels covered\n", static_cast<long>(covered));
  compare("lit and textured, gradients to vertices and lighting",
          {{"plain tensor operations", reference}, {"kernel", shading}}, {2, 15, 2.0});
  compare("against drawing alone (id, depth, barycentrics)",
          {{"lit and textured, forward", forward},
           {"lit and textured, + vertices, lighting", shading},
           {"textured, + vertices", textured},
           {"textured, + a texture of 1024^2", to_texture},
           {"drawing alone", bare}},
          {5, 101, 2.0});
  return 0;
}
