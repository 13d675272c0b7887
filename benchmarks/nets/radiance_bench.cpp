/// The radiance field: what the parts of a training step of 1,000 rays cost, an image's rays drawn in one pass against
/// the same by the modules that training uses, and against a field without a mesh (the same networks, 64 coarse and 128
/// fine samples).
///   radiance_bench [threads = 2]

#include <cstdio>
#include <cstdlib>

#include "doppel/nets/plain_field.h"
#include "doppel/nets/radiance_field.h"
#include "render/bench_mesh.h"
#include "support/ratio.h"

namespace doppel::bench {
namespace {

using torch::Tensor;

int run(int threads) {
  at::set_num_threads(threads);
  constexpr int64_t kRays = 1000, kSamples = 64;
  const BenchMesh body = bench_mesh();
  const TriangleMesh mesh = triangle_mesh(body);
  const ClosestPoint closest(mesh);
  auto generator = at::detail::createCPUGenerator(0);
  const FieldSurface surface{body.vertices, torch::randn({mesh.num_vertices(), 64}, generator)};
  const Tensor target =
      surface.vertices.index_select(0, torch::randint(0, mesh.num_vertices(), {kRays}, generator, torch::kInt64));
  const Tensor origin = torch::tensor({0.0f, 0.2f, -4.0f}), away = target - origin;
  const Tensor length = away.norm(2, {1}), direction = away / length.unsqueeze(1);
  const Tensor near = length - 0.05, far = length + 0.05;
  const RaySamples samples = sample_cells(near, far, kSamples);
  RadianceField field{RadianceFieldConfig()};
  std::printf("%s, %d faces, %ld rays of %ld samples, %d threads\n", body.name.c_str(), mesh.num_faces(),
              static_cast<long>(kRays), static_cast<long>(kSamples), threads);

  RatioOptions few;
  few.warm_up = 1;
  few.turns = 7;
  const Tensor points = samples.points(origin, direction).reshape({1, kRays * kSamples, 3});
  Tensor values = surface.values.clone().requires_grad_();
  Tensor density = 100.0 * torch::rand({kRays, kSamples}, generator);
  Tensor colour = torch::rand({kRays, kSamples, 3}, generator);
  density.requires_grad_();
  colour.requires_grad_();
  compare("a training step, forward and backward",
          {{"closest points", [&] { closest->forward(surface.vertices.unsqueeze(0), points); }},
           {"closest points and features",
            [&] {
              const ClosestPoints at = closest->forward(surface.vertices.unsqueeze(0), points);
              closest->interpolate(at, values.unsqueeze(0)).sum().backward();
            }},
           {"volume rendering",
            [&] {
              const RenderedRays seen = render_volume(density, colour, samples);
              (seen.colour.sum() + seen.opacity.sum() + seen.variance.sum()).backward();
            }},
           {"everything",
            [&] {
              const RenderedRays seen =
                  render_field(field, closest, {surface.vertices, values}, origin, direction, samples);
              (seen.colour.sum() + seen.opacity.sum() + seen.variance.sum()).backward();
            }}},
          few);

  const auto by_modules = [&] {
    const torch::NoGradGuard no_grad;
    return render_field(field, closest, surface, origin, direction, samples);
  };
  const auto in_one_pass = [&] { return draw_field(field, closest, surface, origin, direction, near, far); };
  std::printf("largest difference of the colours %.1e\n",
              (by_modules().colour - in_one_pass().colour).abs().max().item<double>());
  PlainField plain(surface.vertices, PlainFieldConfig());
  const auto without_mesh = [&] {
    const torch::NoGradGuard no_grad;
    plain->render(origin, direction);
  };
  compare("an image's rays",
          {{"in one pass", [&] { in_one_pass(); }},
           {"by the modules", [&] { by_modules(); }},
           {"without a mesh", without_mesh}},
          few);
  return 0;
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) { return doppel::bench::run(argc > 1 ? std::atoi(argv[1]) : 2); }
