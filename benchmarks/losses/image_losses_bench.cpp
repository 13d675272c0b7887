// The losses between images and the Laplacian loss, value and gradient: fused kernels against plain tensor
// operations.
//   image_losses_bench [threads=2]

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/chroma.h"
#include "doppel/losses/laplacian.h"
#include "doppel/losses/lighting.h"
#include "doppel/losses/photometric.h"
#include "support/ratio.h"

namespace {

using namespace doppel;
using namespace doppel::bench;
using torch::Tensor;

/// Times value and gradient to `input`, after the check that both ways give the same.
void time_both(const std::string& title, const Tensor& input, const std::function<Tensor()>& loss) {
  const auto gradient = [&] { return torch::autograd::grad({loss()}, {input})[0]; };
  const auto by_reference = [&] {
    const ReferenceScope reference;
    return gradient();
  };
  const Tensor expected = by_reference();
  if (!torch::allclose(gradient(), expected, 1e-3, 1e-4 * expected.abs().max().item<double>())) {
    std::fprintf(stderr, "%s: kernel and reference differ\n", title.c_str());
    std::exit(1);
  }
  compare(title, {{"reference", by_reference}, {"kernel", gradient}}, {2, 15, 2.0});
}

/// A person is a third of the crop, roughly: a disc.
Tensor disc(int64_t batch, int64_t cameras, int64_t size, double radius) {
  const Tensor x = torch::arange(size, torch::kFloat32) + 0.5f - static_cast<float>(size) / 2;
  const Tensor inside = x.square().unsqueeze(0) + x.square().unsqueeze(1) < radius * radius;
  return inside.expand({batch, cameras, size, size}).contiguous();
}

void time_images(int64_t batch, int64_t cameras, int64_t size) {
  const std::string what = ", forward + backward, " + std::to_string(batch) + " x " + std::to_string(cameras) +
                           " images of " + std::to_string(size) + "^2";
  const Tensor rendered = torch::rand({batch, cameras, size, size, 3}).requires_grad_();
  const Tensor target = torch::rand({batch, cameras, size, size, 3});
  const Tensor covered = disc(batch, cameras, size, 0.31 * size);
  const Tensor mask = disc(batch, cameras, size, 0.33 * size).to(torch::kUInt8);
  time_both("chroma loss" + what, rendered, [&] { return chroma_loss(rendered, covered, target, mask); });
  time_both("lighting loss" + what, rendered, [&] { return lighting_loss(rendered, covered, target, mask); });
  time_both("photometric loss" + what, rendered, [&] { return photometric_loss(rendered, covered, target, mask); });
}

/// A closed grid as fine as a template of 5,508 vertices.
LaplacianGraph grid_graph(int rows, int columns) {
  std::vector<std::array<int, 2>> edges;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const int here = r * columns + c, right = r * columns + (c + 1) % columns, below = (r + 1) % rows * columns + c,
                across = (r + 1) % rows * columns + (c + 1) % columns;
      for (int other : {right, below, across}) edges.push_back({std::min(here, other), std::max(here, other)});
    }
  return LaplacianGraph(MeshTopology(rows * columns, edges), std::vector<double>(rows * columns, 1.0));
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  time_images(2, 4, 512);
  time_images(1, 1, 1024);
  const LaplacianGraph graph = grid_graph(68, 81);
  const Tensor coarse = torch::rand({8, graph.num_vertices, 3});
  const Tensor fine = (coarse + 0.01 * torch::randn_like(coarse)).requires_grad_();
  time_both("Laplacian loss, forward + backward, 8 x 5,508 vertices", fine,
            [&] { return laplacian_loss(fine, coarse, graph); });
}
