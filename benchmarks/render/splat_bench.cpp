// Gaussian splats of a capsule of the size of a person: kernel against plain tensor operations in a small scene, whose
// images must agree; then forward and backward of three scenes, and what they cost for each pixel that a Gaussian adds
// to.
//   splat_bench [threads=1] [Gaussians pixels]      default: three scenes

#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <cstdlib>

#include "doppel/core/process.h"
#include "doppel/render/splats/splats.h"
#include "support/ratio.h"

namespace {

using namespace doppel;
using namespace doppel::bench;
using torch::Tensor;

constexpr double kLength = 1.75, kRadius = 0.25;  // metres

/// Points uniform on a capsule along y, with their unit normals. @return two tensors [n,3]
std::pair<Tensor, Tensor> capsule(std::int64_t n, at::Generator generator) {
  const double straight = kLength - 2 * kRadius, side = 2 * M_PI * kRadius * straight,
               caps = 4 * M_PI * kRadius * kRadius;
  const Tensor on_side = torch::rand({n}, generator) < side / (side + caps);
  const Tensor phi = torch::rand({n}, generator) * (2 * M_PI), z = torch::rand({n}, generator) * 2 - 1;
  const Tensor up = torch::where(on_side, torch::zeros_like(z), z), flat = (1 - up * up).sqrt();
  const Tensor normal = torch::stack({flat * phi.cos(), up, flat * phi.sin()}, 1);
  const Tensor shift = torch::where(on_side, z, z.sign()) * (straight / 2);
  return {normal * kRadius + torch::stack({torch::zeros_like(z), shift, torch::zeros_like(z)}, 1), normal};
}

/// Quaternions w x y z that turn the z axis to the normals.
Tensor towards(const Tensor& normals) {
  const Tensor x = normals.select(1, 0), y = normals.select(1, 1), z = normals.select(1, 2);
  return torch::stack({1.0 + z.clamp_min(-0.999), -y, x, torch::zeros_like(x)}, 1);
}

Splats scene(std::int64_t n) {
  auto generator = at::detail::createCPUGenerator(1);
  const auto [points, normals] = capsule(n, generator);
  const Tensor tangent = torch::rand({n, 2}, generator) * 0.003 + 0.003;
  Splats s;
  s.positions = points.unsqueeze(0).contiguous();
  s.rotations = towards(normals).unsqueeze(0).contiguous();
  s.log_scales = torch::cat({tangent, torch::full({n, 1}, 0.001)}, 1).log().unsqueeze(0).contiguous();
  s.opacities = torch::full({1, n}, std::log(0.9 / 0.1));
  s.harmonics = (torch::rand({1, n, 1, 3}, generator) - 0.5) / 0.28209479177387814;
  for (Tensor* t : {&s.positions, &s.rotations, &s.log_scales, &s.opacities, &s.harmonics})
    *t = t->to(torch::kFloat32).requires_grad_();
  return s;
}

/// 3.5 m away; the body fills 80 % of the height.
Tensor camera(std::int64_t size) {
  const double f = 1.6 * static_cast<double>(size), c = static_cast<double>(size) / 2;
  return torch::tensor({f, 0.0, c, 3.5 * c, 0.0, -f, c, 3.5 * c, 0.0, 0.0, 1.0, 3.5}, torch::kFloat32)
      .view({1, 1, 3, 4});
}

/// Forward and backward to all parameters.
struct Step {
  const Splats& splats;
  Tensor projection;
  std::int64_t size;
  SplatOptions options;
  Tensor upstream = torch::full({1, 1, size, size, 3}, 1e-3);

  void forward() const {
    const torch::NoGradGuard no_gradient;
    draw_splats(splats, projection, size, size, options);
  }
  void operator()() const {
    const Tensor colour = draw_splats(splats, projection, size, size, options).colour;
    torch::autograd::grad({colour},
                          {splats.positions, splats.rotations, splats.log_scales, splats.opacities, splats.harmonics},
                          {upstream});
  }
};

/// The work of drawing a scene.
struct Work {
  std::int64_t blends = 0;   ///< pixels that the Gaussians add to
  std::int64_t vectors = 0;  ///< of eight pixels, that hold the runs of these pixels in rows
};

/// Counted one by one, by the formulas of splats.h.
Work count_work(const Splats& s, const Tensor& projection, std::int64_t size) {
  const torch::NoGradGuard no_gradient;
  const Tensor p = projection[0][0].to(torch::kFloat64), x = s.positions[0].to(torch::kFloat64);
  const Tensor h = x.matmul(p.slice(1, 0, 3).t()) + p.select(1, 3), uv = h.slice(1, 0, 2) / h.slice(1, 2, 3);
  const Tensor jacobian =
      (p.slice(0, 0, 2).slice(1, 0, 3) - uv.unsqueeze(2) * p[2].slice(0, 0, 3)) / h.select(1, 2).view({-1, 1, 1});
  const Tensor q = s.rotations[0].to(torch::kFloat64), unit = q / q.norm(2, 1, true), scale = s.log_scales[0].exp();
  const Tensor w = unit.select(1, 0), a = unit.select(1, 1), b = unit.select(1, 2), c = unit.select(1, 3);
  const Tensor rotation = torch::stack({1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b),
                                        2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a),
                                        2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)},
                                       1)
                              .view({-1, 3, 3});
  const Tensor along = jacobian.matmul(rotation * scale.to(torch::kFloat64).unsqueeze(1));
  const Tensor conics =
      (along.matmul(along.transpose(1, 2)) + 0.3 * torch::eye(2, torch::kFloat64)).inverse().contiguous();
  const Tensor order = (x - torch::tensor({0.0, 0.0, -3.5}, torch::kFloat64)).norm(2, 1).argsort();
  const Tensor opacity = s.opacities[0].sigmoid().contiguous(), centres = uv.contiguous();
  std::vector<float> through(static_cast<std::size_t>(size * size), 1.0f);
  Work work;
  for (std::int64_t k = 0; k < order.size(0); ++k) {
    const std::int64_t i = order.data_ptr<std::int64_t>()[k];
    const double *m = centres.data_ptr<double>() + 2 * i, *s2 = conics.data_ptr<double>() + 4 * i;
    const double determinant = s2[0] * s2[3] - s2[1] * s2[2], o = opacity.data_ptr<float>()[i];
    const double reach = 2 * std::log(255 * o), rx = std::sqrt(reach * s2[3] / determinant),
                 ry = std::sqrt(reach * s2[0] / determinant);
    const auto last = static_cast<double>(size - 1);
    int run = 0;
    for (auto py = static_cast<int>(std::max(m[1] - ry - 0.5, 0.0)); py <= std::min(m[1] + ry, last); ++py) {
      for (auto px = static_cast<int>(std::max(m[0] - rx - 0.5, 0.0)); px <= std::min(m[0] + rx, last); ++px) {
        const double dx = px + 0.5 - m[0], dy = py + 0.5 - m[1];
        const double alpha =
            std::min(0.99, o * std::exp(-0.5 * (s2[0] * dx * dx + 2 * s2[1] * dx * dy + s2[3] * dy * dy)));
        float& t = through[static_cast<std::size_t>(py * size + px)];
        if (alpha < 1.0 / 255 || t < 1e-4f) continue;
        t *= static_cast<float>(1.0 - alpha);
        ++run;
      }
      work.blends += run;
      work.vectors += (run + 7) / 8;
      run = 0;
    }
  }
  return work;
}

/// Cycles of this core in a nanosecond: a chain of additions, each of which takes one.
double measured_clock() {
  constexpr int kAdditions = 200'000'000;
  double best = 0.0;
  for (int repeat = 0; repeat < 3; ++repeat) {
    const double ms = time_turn(
        [] {
          std::uint64_t sum = 0;
          for (int i = 0; i < kAdditions / 8; ++i)
            for (int k = 0; k < 8; ++k) {
              sum += 1;
              asm volatile("" : "+r"(sum));
            }
        },
        0.0);
    best = std::max(best, kAdditions / (1e6 * ms));
  }
  return best;
}

/// The least time of a core with vectors of eight floats, four instructions a cycle, two of them multiplications. Eight
/// pixels of a Gaussian take 27 instructions forward (6.75 cycles) and, backward, 41 with 22 multiplications (11
/// cycles). Projection, sorting and gathering take about 28 cycles a Gaussian, and 11 more backward.
double bound_ms(const Work& work, std::int64_t gaussians, bool backward, double clock) {
  const double cycles = static_cast<double>(work.vectors) * (6.75 + (backward ? 11.0 : 0.0)) +
                        static_cast<double>(gaussians) * (28.0 + (backward ? 11.0 : 0.0));
  return 1e-6 * cycles / clock;
}

}  // namespace

int main(int argc, char** argv) {
  doppel::setup_process();
  const int threads = argc > 1 ? std::atoi(argv[1]) : 1;
  at::set_num_threads(threads);
  std::printf("%d threads\n", threads);
  if (argc <= 3) {
    const Splats small = scene(2000);
    SplatOptions plain;
    plain.use_reference = true;
    const Tensor drawn = draw_splats(small, camera(64), 64, 64).colour,
                 expected = draw_splats(small, camera(64), 64, 64, plain).colour;
    if ((drawn - expected).abs().max().item<double>() > 1e-4) {
      std::puts("kernel and plain tensor operations disagree");
      return 1;
    }
    const Step reference{small, camera(64), 64, plain}, kernel{small, camera(64), 64, {}};
    compare("2,000 Gaussians, 64 x 64, forward and backward",
            {{"plain tensor operations", reference}, {"kernel", kernel}}, {1, 5, 2.0});
  }
  const double clock = measured_clock();
  std::vector<std::pair<int, int>> scenes{{40000, 512}, {40000, 1024}, {120000, 1024}};
  if (argc > 3) scenes = {{std::atoi(argv[2]), std::atoi(argv[3])}};
  for (const auto& [count, size] : scenes) {
    const Splats splats = scene(count);
    const Step step{splats, camera(size), size, {}};
    const std::vector<Timing> times =
        compare(std::to_string(count) + " Gaussians, " + std::to_string(size) + " x " + std::to_string(size),
                {{"forward", [&step = step] { step.forward(); }}, {"forward + backward", step}}, {5, 41, 2.0});
    const Work work = count_work(splats, camera(size), size);
    const auto blends = static_cast<double>(work.blends);
    std::printf("  %.0f pixels blended: %.2f and %.2f ns for each one", blends, 1e6 * times[0].median_ms / blends,
                1e6 * times[1].median_ms / blends);
    if (threads == 1) {
      const double forward = bound_ms(work, count, false, clock), both = bound_ms(work, count, true, clock);
      std::printf("; %.1f x the bound of %.2f ms and %.1f x that of %.2f ms", times[0].median_ms / forward, forward,
                  times[1].median_ms / both, both);
    }
    std::puts("");
  }
  return 0;
}
