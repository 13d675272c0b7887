#include "doppel/render/shading/shading.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/optim/adam.h>
#include <torch/optim/lbfgs.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/projection.h"
#include "render/shading_scene.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::shading_test {
namespace {

using support::message_of;
using test::ShadingScene;
using torch::Tensor;

constexpr double kMargin = 0.01;

ShadedImage draw(const ShadingScene& s, const ShadingOptions& options = {}) {
  return shade(s.vertices, s.texture, s.lighting, s.projection, s.mesh, s.height, s.width, options);
}

class ThreadCount {
 public:
  explicit ThreadCount(int threads) : before_(at::get_num_threads()) { at::set_num_threads(threads); }
  ~ThreadCount() { at::set_num_threads(before_); }
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int before_;
};

/// Colour and gradients of sum(weight * colour).
std::vector<Tensor> value_and_gradients(ShadingScene s, const Tensor& weight, const ShadingOptions& options = {}) {
  for (Tensor* t : {&s.vertices, &s.texture, &s.lighting}) *t = t->detach().clone().requires_grad_();
  const ShadedImage image = draw(s, options);
  const std::vector<Tensor> inputs =
      options.lit ? std::vector<Tensor>{s.vertices, s.texture, s.lighting} : std::vector<Tensor>{s.vertices, s.texture};
  std::vector<Tensor> out{image.colour.detach(), image.mask};
  const auto gradients =
      torch::autograd::grad({(image.colour * weight.to(image.colour.dtype())).sum()}, inputs, {}, {}, false, true);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    out.push_back(gradients[i].defined() ? gradients[i] : torch::zeros_like(inputs[i]));
  }
  return out;
}

Tensor random_weight(const ShadingScene& s) {
  auto generator = at::detail::createCPUGenerator(3);
  return torch::randn({s.vertices.size(0), s.projection.size(1), s.height, s.width, 3}, generator, torch::kFloat64) *
         test::inner_pixels(s, kMargin);
}

// --- the reference against definitions -------------------------------------------------------------------------------

TEST(ShadingReference, ShowsALinearTextureWhereTheProjectionPutsIt) {
  // A slanted quadrilateral whose texture is linear in u and v: every pixel's colour follows from its ray.
  const Tensor vertices =
      torch::tensor({-0.6, -0.5, 1.5, 0.6, -0.5, 3.0, 0.6, 0.6, 3.2, -0.6, 0.6, 1.7}, torch::kFloat64)
          .reshape({1, 4, 3});
  const Tensor uvs = torch::tensor({0.1f, 0.1f, 0.9f, 0.1f, 0.9f, 0.9f, 0.1f, 0.1f, 0.9f, 0.9f, 0.1f, 0.9f});
  const RenderMesh mesh(torch::tensor({0, 1, 2, 0, 2, 3}, torch::kInt32).reshape({2, 3}), uvs.reshape({2, 3, 2}), 4);
  const int size = 64;
  const Tensor column = (torch::arange(size, torch::kFloat64) + 0.5) / size;
  const Tensor u = column.reshape({1, size}).expand({size, size}),
               v = 1 - column.reshape({size, 1}).expand({size, size});
  const Tensor texture = torch::stack({u, v, u + v}, 2).unsqueeze(0).contiguous();
  const Tensor projection =
      torch::tensor({70.0, 4.0, 35.0, 3.0, 0.0, 66.0, 29.0, -2.0, 0.0, 0.0, 1.0, 0.1}, torch::kFloat64)
          .reshape({1, 1, 3, 4});
  ShadingOptions options;
  options.lit = false;
  const ShadedImage image = shade(vertices, texture, {}, projection, mesh, 60, 70, options);
  // Points of known (s, t) on the quadrilateral (planar: corner 2 completes a parallelogram), their pixels, the colour.
  int checked = 0;
  for (double s = 0.1; s < 0.95; s += 0.09) {
    for (double t = 0.1; t < 0.95; t += 0.09) {
      const Tensor x = vertices[0][0] + s * (vertices[0][1] - vertices[0][0]) + t * (vertices[0][3] - vertices[0][0]);
      const Tensor pixel = project(x.reshape({1, 1, 3}), projection).flatten() - 0.5;
      const Tensor low = pixel.floor();
      const auto px = low[0].item<std::int64_t>(), py = low[1].item<std::int64_t>();
      if (px < 0 || py < 0 || px > 68 || py > 58) continue;
      if (!image.mask[0][0].slice(0, py, py + 2).slice(1, px, px + 2).all().item<bool>()) continue;
      const double fx = (pixel - low)[0].item<double>(), fy = (pixel - low)[1].item<double>();
      const auto at = [&](int dx, int dy) { return image.colour[0][0][py + dy][px + dx]; };
      const Tensor colour =
          (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy;
      EXPECT_NEAR(colour[0].item<double>(), 0.1 + 0.8 * s, 2e-3);
      EXPECT_NEAR(colour[1].item<double>(), 0.1 + 0.8 * t, 2e-3);
      ++checked;
    }
  }
  EXPECT_GT(checked, 40);
}

TEST(ShadingReference, LightsASphereAsItsNormalsSay) {
  ShadingScene s = test::shading_scene(1, 1, 64, 64, 48);
  const test::Mesh ball = test::sphere(48, 0.5f);
  s.vertices = ball.vertices.unsqueeze(0).to(torch::kFloat64);
  s.texture = torch::ones({1, 2, 2, 3}, torch::kFloat64);
  const ShadedImage image = draw(s);
  Rasterizer rasterizer(ball.faces);
  const RasterImage& seen =
      rasterizer.rasterize_projected(s.vertices.to(torch::kFloat32), s.projection.to(torch::kFloat32), 64, 64);
  const Tensor corners =
      ball.faces.to(torch::kInt64).index_select(0, seen.face_id.flatten().clamp_min(0).to(torch::kInt64));
  const Tensor x = (s.vertices[0].index_select(0, corners.flatten()).reshape({-1, 3, 3}) *
                    seen.barycentrics.reshape({-1, 3, 1}).to(torch::kFloat64))
                       .sum(1);
  const Tensor normal = x / x.norm(2, 1, true).clamp_min(1e-9);
  const Tensor expected =
      torch::matmul(sh_basis(normal), s.lighting[0][0].t()).reshape({64, 64, 3}) * image.mask[0][0].unsqueeze(2);
  EXPECT_TRUE(test::is_near(image.colour[0][0], expected, 0.02));
  EXPECT_GT(image.mask.sum().item<int>(), 400);
}

TEST(ShadingReference, TurnsNormalsTowardsTheCamera) {
  const ShadingScene s = test::shading_scene(1, 2, 48, 48);
  ShadingScene inside_out = s;
  inside_out.mesh = RenderMesh(s.mesh.faces.flip({1}), s.mesh.corner_uvs.flip({1}), s.mesh.num_vertices);
  EXPECT_TRUE(test::is_near(draw(inside_out).colour, draw(s).colour, 1e-9));
  ShadingOptions as_is;
  as_is.flip_normals = false;
  EXPECT_FALSE(test::is_near(draw(inside_out, as_is).colour, draw(s).colour, 1e-2));
}

TEST(ShLighting, HasAnOrthonormalBasisAndAnIdentity) {
  auto generator = at::detail::createCPUGenerator(1);
  const Tensor n = torch::randn({200000, 3}, generator, torch::kFloat64);
  const Tensor sh = sh_basis(n / n.norm(2, 1, true)) * sh_constants();
  const Tensor gram = torch::matmul(sh.t(), sh) * (4 * M_PI / 200000);
  EXPECT_TRUE(test::is_near(gram, torch::eye(9, torch::kFloat64), 0.02));
  EXPECT_TRUE(test::is_near(torch::matmul(sh_basis(n.slice(0, 0, 5)), identity_lighting().to(torch::kFloat64).t()),
                            torch::ones({5, 3}), 1e-12));
}

// --- gradients of the reference --------------------------------------------------------------------------------------

TEST(ShadingGradient, OfVerticesTextureAndLightingMatchCentralDifferences) {
  const ShadingScene s = test::shading_scene(2, 2, 30, 37, 5);
  const Tensor inside = test::inner_pixels(s, 0.02);
  const auto f = [&](const std::vector<Tensor>& x) {
    return shade(x[0], x[1], x[2], s.projection, s.mesh, s.height, s.width).colour * inside;
  };
  EXPECT_TRUE(test::gradients_match(f, {{"vertices", s.vertices}, {"texture", s.texture}, {"lighting", s.lighting}},
                                    {1e-6, 1e-5, 1e-5, 90}));
}

TEST(ShadingGradient, OfUnlitTexturesOfEachView) {
  const ShadingScene s = test::shading_scene(2, 2, 26, 26, 5);
  const Tensor inside = test::inner_pixels(s, 0.02);
  ShadingOptions options;
  options.lit = false;
  const Tensor textures = s.texture.repeat({4, 1, 1, 1}) * torch::arange(1, 5, torch::kFloat64).reshape({4, 1, 1, 1});
  const auto f = [&](const std::vector<Tensor>& x) {
    return shade(x[0], x[1], {}, s.projection, s.mesh, s.height, s.width, options).colour * inside;
  };
  EXPECT_TRUE(test::gradients_match(f, {{"vertices", s.vertices}, {"texture", textures}}, {1e-6, 1e-5, 1e-5, 60}));
}

TEST(ShadingGradient, OfTheTargetIsThatOfItsValueUnderAMovingPoint) {
  // On a target that is linear in the pixel, the value under a surface point is known exactly.
  const ShadingScene s = test::shading_scene(1, 2, 40, 40, 6);
  const Tensor x = (torch::arange(40, torch::kFloat64) + 0.5).reshape({1, 40}).expand({40, 40});
  const Tensor target =
      torch::stack({0.01 * x, 0.02 * x.t(), 0.005 * x - 0.01 * x.t()}, 2).expand({1, 2, 40, 40, 3}).contiguous();
  for (const int radius : {1, 3}) {
    const Tensor vertices = s.vertices.clone().requires_grad_();
    const Tensor value = target_on_surface(vertices, s.projection, s.mesh, target, radius);
    EXPECT_TRUE(torch::equal(value.detach(), target));
    const Tensor gradient = torch::autograd::grad({value.select(4, 0).sum()}, {vertices})[0];
    // Red is 0.01 u: the sum over surface points of 0.01 du, with barycentrics fixed, by central differences.
    Rasterizer rasterizer(s.mesh.faces);
    const RasterImage& seen =
        rasterizer.rasterize_projected(s.vertices.to(torch::kFloat32), s.projection.to(torch::kFloat32), 40, 40);
    Tensor border = torch::zeros({2, 40, 40}, torch::kFloat64);
    border.slice(1, radius, 40 - radius).slice(2, radius, 40 - radius).fill_(1);
    const Tensor used = border * (seen.face_id >= 0);
    const Tensor corners =
        s.mesh.faces.to(torch::kInt64).index_select(0, seen.face_id.flatten().clamp_min(0).to(torch::kInt64));
    const auto sum = [&](const Tensor& moved) {
      const Tensor points = (moved[0].index_select(0, corners.flatten()).reshape({-1, 3, 3}) *
                             seen.barycentrics.reshape({-1, 3, 1}).to(torch::kFloat64))
                                .sum(1)
                                .reshape({2, 1600, 3});
      Tensor total = torch::zeros({}, torch::kFloat64);
      for (int c = 0; c < 2; ++c) {
        const Tensor pixel = project(points.slice(0, c, c + 1), s.projection.slice(1, c, c + 1));
        total = total + 0.01 * (pixel.reshape({-1, 2}).select(1, 0) * used[c].flatten()).sum();
      }
      return total.item<double>();
    };
    for (const std::int64_t i : {3, 17, 30, 44}) {
      for (int d = 0; d < 3; ++d) {
        Tensor above = s.vertices.clone(), below = s.vertices.clone();
        above[0][i][d] += 1e-5;
        below[0][i][d] -= 1e-5;
        EXPECT_NEAR(gradient[0][i][d].item<double>(), (sum(above) - sum(below)) / 2e-5, 2e-4) << i << " " << d;
      }
    }
  }
}

// --- the kernel against the reference --------------------------------------------------------------------------------

struct Case {
  std::int64_t batch, cameras, height, width;
  bool lit, nearest, textured;
};

TEST(ShadingAgrees, KernelWithReferenceInValueAndGradient) {
  for (const Case& c : {Case{2, 3, 75, 131, true, false, true}, Case{1, 1, 64, 64, true, true, true},
                        Case{1, 2, 1, 97, true, false, true}, Case{3, 1, 70, 33, false, false, true},
                        Case{1, 2, 66, 50, true, false, false}, Case{1, 1, 200, 130, false, true, true}}) {
    ShadingScene s = test::shading_scene(c.batch, c.cameras, c.height, c.width);
    if (!c.textured) s.texture = torch::ones({1, 1, 1, 3}, torch::kFloat64);
    ShadingOptions options;
    options.lit = c.lit;
    options.nearest = c.nearest;
    const Tensor weight = random_weight(s);
    const auto expected = value_and_gradients(s, weight, options);
    const auto found = value_and_gradients(s.to(torch::kFloat32), weight, options);
    SCOPED_TRACE(testing::Message() << c.height << " x " << c.width << " lit " << c.lit << " nearest " << c.nearest);
    EXPECT_TRUE(torch::equal(found[1], expected[1]));
    const Tensor inside = test::inner_pixels(s, kMargin);
    if (!c.nearest) {
      EXPECT_TRUE(test::is_near(found[0] * inside, expected[0] * inside, 5e-4));
    }
    for (std::size_t i = 2; i < expected.size(); ++i) {
      const double scale = std::max(expected[i].abs().max().item<double>(), 1e-3);
      const double allowed = c.nearest ? 0.05 : 1e-3;  // a texel's border may fall to either side
      EXPECT_TRUE(test::is_near(found[i], expected[i], allowed * scale)) << "input " << i - 2;
    }
  }
}

TEST(ShadingAgrees, InEveryBitForOneTwoAndThreeThreads) {
  for (const std::int64_t cameras : {1, 5}) {
    const ShadingScene s = test::shading_scene(2, cameras, 201, 150, 20).to(torch::kFloat32);
    const Tensor weight = random_weight(s);
    std::vector<std::vector<Tensor>> results;
    for (const int threads : {1, 2, 3}) {
      const ThreadCount count(threads);
      results.push_back(value_and_gradients(s, weight));
    }
    for (std::size_t i = 0; i < results[0].size(); ++i) {
      EXPECT_TRUE(torch::equal(results[0][i], results[1][i])) << i;
      EXPECT_TRUE(torch::equal(results[0][i], results[2][i])) << i;
    }
    EXPECT_GT(results[0][2].abs().max().item<float>(), 0);
  }
}

TEST(ShadingAgrees, OnTexturesPerItemAndPerView) {
  for (const std::int64_t textures : {2, 6}) {
    ShadingScene s = test::shading_scene(2, 3, 60, 60);
    s.texture = s.texture.repeat({textures, 1, 1, 1}) *
                torch::arange(1, textures + 1, torch::kFloat64).reshape({textures, 1, 1, 1});
    const Tensor weight = random_weight(s);
    const auto expected = value_and_gradients(s, weight), found = value_and_gradients(s.to(torch::kFloat32), weight);
    const Tensor inside = test::inner_pixels(s, kMargin);
    EXPECT_TRUE(test::is_near(found[0] * inside, expected[0] * inside, 2e-3));
    EXPECT_TRUE(test::is_near(found[3], expected[3], 1e-3 * expected[3].abs().max().item<double>()));
    for (std::int64_t t = 0; t < textures; ++t) EXPECT_GT(found[3][t].abs().max().item<float>(), 0.1f);
  }
}

TEST(ShadingAgrees, OnTheTargetTerm) {
  for (const int radius : {1, 2}) {
    const ShadingScene s = test::shading_scene(2, 2, 70, 83);
    auto generator = at::detail::createCPUGenerator(9);
    const Tensor target = torch::rand({2, 2, 70, 83, 3}, generator, torch::kFloat64), weight = random_weight(s);
    const auto gradients = [&](torch::ScalarType type, bool reuse) {
      const Tensor vertices = s.vertices.to(type).requires_grad_(), image = target.to(type).requires_grad_();
      TargetOptions options;
      options.radius = radius;
      const ShadingScene t = s.to(type);
      ShadedImage drawn;
      if (reuse) drawn = shade(vertices, t.texture, t.lighting, t.projection, t.mesh, t.height, t.width);
      const Tensor value = target_on_surface(vertices, t.projection, t.mesh, image, options, reuse ? &drawn : nullptr);
      return torch::autograd::grad({(value * weight.to(type)).sum()}, {vertices, image});
    };
    const auto expected = gradients(torch::kFloat64, false), found = gradients(torch::kFloat32, false);
    const double scale = expected[0].abs().max().item<double>();
    EXPECT_TRUE(test::is_near(found[0], expected[0], 1e-3 * scale));
    EXPECT_TRUE(test::is_near(found[1], weight, 1e-6));
    EXPECT_TRUE(torch::equal(gradients(torch::kFloat32, true)[0], found[0]));
    const ThreadCount three(3);
    EXPECT_TRUE(torch::equal(gradients(torch::kFloat32, false)[0], found[0]));
  }
}

TEST(ShadingAgrees, OnNothingToDraw) {
  for (const auto& [batch, cameras] : {std::pair<std::int64_t, std::int64_t>{0, 2}, {2, 0}}) {
    const ShadingScene s = test::shading_scene(batch, cameras, 20, 30).to(torch::kFloat32);
    const Tensor weight = torch::zeros({batch, cameras, 20, 30, 3});
    const auto out = value_and_gradients(s, weight);
    EXPECT_EQ(out[0].sizes(), weight.sizes());
    EXPECT_EQ(out[2].sizes(), s.vertices.sizes());
    EXPECT_EQ(out[3].abs().sum().item<float>(), 0);
  }
  ShadingScene away = test::shading_scene(1, 1, 20, 30).to(torch::kFloat32);
  away.vertices += 100;
  away.projection.zero_();  // a view that does not exist
  const auto out = value_and_gradients(away, torch::ones({1, 1, 20, 30, 3}));
  for (const std::size_t i : {0, 2, 3, 4}) EXPECT_EQ(out[i].abs().sum().item<float>(), 0) << i;
}

TEST(ShadingAgrees, InsideTheMeshAndThroughTheNearPlane) {
  for (const double distance : {0.0, 0.3, 0.49}) {
    ShadingScene s = test::shading_scene(1, 2, 64, 80, 9);
    for (int c = 0; c < 2; ++c) s.projection[0][c] = test::orbit_projection(0.4 + c, distance, 60, 64);
    const Tensor weight = random_weight(s);
    const auto expected = value_and_gradients(s, weight), found = value_and_gradients(s.to(torch::kFloat32), weight);
    EXPECT_GT(found[1].to(torch::kFloat32).mean().item<float>(), 0.5f);
    EXPECT_TRUE(torch::equal(found[1], expected[1]));
    const Tensor inside = test::inner_pixels(s, kMargin);
    EXPECT_TRUE(test::is_near(found[0] * inside, expected[0] * inside, 2e-3));
    for (std::size_t i = 2; i < found.size(); ++i) {
      EXPECT_TRUE(torch::isfinite(found[i]).all().item<bool>()) << i;
      EXPECT_TRUE(test::is_near(found[i], expected[i], 3e-3 * expected[i].abs().max().item<double>())) << i;
    }
  }
}

TEST(ShadingAgrees, WithFacesOfNoAreaFinite) {
  ShadingScene s = test::shading_scene(1, 2, 50, 50).to(torch::kFloat32);
  s.vertices = torch::zeros_like(s.vertices);
  s.vertices.select(2, 0) = torch::linspace(-0.5, 0.5, s.vertices.size(1));
  for (const Tensor& t : value_and_gradients(s, torch::ones({1, 2, 50, 50, 3}))) {
    EXPECT_TRUE(torch::isfinite(t.to(torch::kFloat32)).all().item<bool>());
  }
}

// --- what it is for --------------------------------------------------------------------------------------------------

TEST(ShadingRecovers, TheLightingOfATexturedSphere) {
  const ThreadCount one(1);  // hundreds of small steps: threads only wait for each other on a busy machine
  ShadingScene s = test::shading_scene(1, 2, 96, 96, 24).to(torch::kFloat32);
  const test::Mesh ball = test::sphere(24, 0.5f);
  s.vertices = ball.vertices.unsqueeze(0);
  s.texture = 0.3 + 0.7 * s.texture;
  const Tensor target = draw(s).colour;
  Tensor lighting = identity_lighting().expand({1, 2, 3, 9}).clone().requires_grad_();
  const auto settings = torch::optim::LBFGSOptions(1)
                            .max_iter(200)
                            .max_eval(400)
                            .tolerance_grad(1e-8)
                            .tolerance_change(1e-14)
                            .line_search_fn("strong_wolfe");
  torch::optim::LBFGS optimizer(std::vector<Tensor>{lighting}, settings);
  optimizer.step([&] {
    optimizer.zero_grad();
    ShadingScene guess = s;
    guess.lighting = lighting;
    const Tensor loss = (draw(guess).colour - target).square().sum();
    loss.backward();
    return loss;
  });
  EXPECT_TRUE(test::is_near(lighting, s.lighting, 1e-3));
}

/// U and V of RGB in 0..1, both scaled to 0..1.
Tensor chroma(const Tensor& rgb) {
  const Tensor matrix =
      torch::tensor({-0.14714119f, -0.28886916f, 0.43601035f, 0.61497538f, -0.51496512f, -0.10001026f});
  const Tensor uv = torch::matmul(rgb, matrix.reshape({2, 3}).t());
  return 0.5 * uv / torch::tensor({0.43601035f, 0.61497538f}) + 0.5;
}

/// A wall of 9 x 9 vertices with coloured waves, its texture about 0.19 per pixel.
struct Wall {
  RenderMesh mesh;
  Tensor vertices, texture, projection;
};

Wall make_wall() {
  constexpr int n = 9, texels = 96;
  std::vector<float> points, uvs;
  std::vector<std::int32_t> faces;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      points.insert(points.end(), {-0.4f + 0.1f * static_cast<float>(i), -0.4f + 0.1f * static_cast<float>(j), 2.0f});
    }
  }
  const auto uv = [&](int v) {
    uvs.push_back(static_cast<float>(v % n) / (n - 1));
    uvs.push_back(1 - static_cast<float>(v / n) / (n - 1));
  };
  for (int j = 0; j + 1 < n; ++j) {
    for (int i = 0; i + 1 < n; ++i) {
      const int a = j * n + i;
      for (const int v : {a, a + n, a + n + 1, a, a + n + 1, a + 1}) {
        faces.push_back(v);
        uv(v);
      }
    }
  }
  const Tensor x = torch::arange(texels, torch::kFloat32) / texels;
  const Tensor u = x.reshape({1, texels}).expand({texels, texels}), v = x.reshape({texels, 1}).expand({texels, texels});
  const Tensor texture = torch::stack({0.5 + 0.4 * torch::sin(20 * u + 5 * v), 0.5 + 0.3 * torch::cos(17 * v - 4 * u),
                                       0.5 + 0.4 * torch::sin(14 * (u + v))},
                                      2);
  return {
      RenderMesh(torch::tensor(faces, torch::kInt32).reshape({-1, 3}), torch::tensor(uvs).reshape({-1, 3, 2}), n * n),
      torch::tensor(points).reshape({1, n * n, 3}), texture.unsqueeze(0).contiguous(),
      torch::tensor({240.f, 0.f, 64.f, 0.f, 0.f, 240.f, 64.f, 0.f, 0.f, 0.f, 1.f, 0.f}).reshape({1, 1, 3, 4})};
}

TEST(ShadingRecovers, AShiftedWallFromItsColoursAlone) {
  const ThreadCount one(1);
  const Wall wall = make_wall();
  ShadingOptions unlit;
  unlit.lit = false;
  const auto render = [&](const Tensor& vertices) {
    return shade(vertices, wall.texture, {}, wall.projection, wall.mesh, 128, 128, unlit);
  };
  const Tensor target = render(wall.vertices).colour;
  Tensor shift = torch::tensor({6.0f * 2 / 240, 0.f, 0.f}).requires_grad_();  // 6 pixels
  torch::optim::Adam optimizer(std::vector<Tensor>{shift}, torch::optim::AdamOptions(0.002));
  for (int step = 0; step < 120; ++step) {
    optimizer.zero_grad();
    const Tensor vertices = wall.vertices + shift * torch::tensor({1.f, 1.f, 0.f});
    const ShadedImage drawn = render(vertices);
    const Tensor moving = target_on_surface(vertices, wall.projection, wall.mesh, target, {}, &drawn);
    const Tensor both = (drawn.mask & (target.sum(4) > 0)).unsqueeze(4);
    const Tensor loss = ((chroma(drawn.colour) - chroma(moving)) * both).square().sum() / both.sum();
    loss.backward();
    optimizer.step();
  }
  EXPECT_LT((shift * 240 / 2).abs().max().item<float>(), 0.1f) << "pixels " << shift * 240 / 2;
}

// --- bad input -------------------------------------------------------------------------------------------------------

TEST(ShadingRejects, WhatDoesNotFitAndSaysWhat) {
  using testing::HasSubstr;
  const ShadingScene s = test::shading_scene(2, 3, 20, 20).to(torch::kFloat32);
  const auto with = [&](const std::function<void(ShadingScene&)>& change) {
    return message_of<UsageError>([&] {
      ShadingScene t = s;
      change(t);
      draw(t);
    });
  };
  EXPECT_THAT(with([](ShadingScene& t) { t.vertices = t.vertices.slice(1, 1); }), HasSubstr("vertices must be"));
  EXPECT_THAT(with([](ShadingScene& t) { t.vertices = t.vertices.to(torch::kInt32); }),
              HasSubstr("float32 or float64"));
  EXPECT_THAT(with([](ShadingScene& t) { t.projection = t.projection[0]; }), HasSubstr("projection must be"));
  EXPECT_THAT(with([](ShadingScene& t) { t.texture = t.texture.repeat({4, 1, 1, 1}); }), HasSubstr("4 textures"));
  EXPECT_THAT(with([](ShadingScene& t) { t.texture = t.texture.slice(3, 0, 2); }), HasSubstr("texture must be"));
  EXPECT_THAT(with([](ShadingScene& t) { t.texture = t.texture.to(torch::kFloat64); }),
              HasSubstr("texture is float64"));
  EXPECT_THAT(with([](ShadingScene& t) { t.lighting = t.lighting.slice(1, 0, 2); }), HasSubstr("lighting must be"));
  EXPECT_THAT(with([](ShadingScene& t) { t.lighting = Tensor(); }), HasSubstr("no lighting"));
  EXPECT_THAT(with([](ShadingScene& t) { t.height = 0; }), HasSubstr("1 to 16384"));
  EXPECT_THAT(with([](ShadingScene& t) { t.mesh = RenderMesh(t.mesh.faces, {}, t.mesh.num_vertices); }),
              HasSubstr("no UVs"));
  EXPECT_THAT(with([](ShadingScene& t) {
                t.projection = t.projection.clone();
                t.projection[1][2][2] = torch::tensor({0.f, 0.f, 0.f, 1.f});
              }),
              testing::AllOf(HasSubstr("item 1, camera 2"), HasSubstr("no camera centre")));
  const Tensor target = torch::zeros({2, 3, 20, 20, 3});
  EXPECT_THAT(message_of<UsageError>([&] { target_on_surface(s.vertices, s.projection, s.mesh, target[0]); }),
              HasSubstr("target must be"));
  EXPECT_THAT(message_of<UsageError>([&] { target_on_surface(s.vertices, s.projection, s.mesh, target, 0); }),
              HasSubstr("radius"));
  const ShadedImage other = draw(test::shading_scene(2, 3, 30, 20).to(torch::kFloat32));
  EXPECT_THAT(message_of<UsageError>([&] { target_on_surface(s.vertices, s.projection, s.mesh, target, {}, &other); }),
              HasSubstr("same views"));
}

TEST(RenderMeshRejects, WhatDoesNotFit) {
  using testing::HasSubstr;
  const Tensor faces = torch::tensor({0, 1, 2}, torch::kInt32).reshape({1, 3});
  EXPECT_THAT(message_of<UsageError>([&] { RenderMesh(faces, {}, 2); }), HasSubstr("vertex 2"));
  EXPECT_THAT(message_of<UsageError>([&] { RenderMesh(faces, torch::zeros({2, 3, 2}), 3); }), HasSubstr("corner_uvs"));
  TriangleMesh mesh;
  mesh.vertices.resize(3);
  mesh.faces = {{0, 1, 2}};
  mesh.face_uvs = {{0, 1, 7}};
  mesh.uvs.resize(3);
  EXPECT_THAT(message_of<UsageError>([&] { RenderMesh render_mesh(mesh); }), HasSubstr("UV 7"));
  EXPECT_THAT(message_of<UsageError>([&] { texture_tensor(mesh); }), HasSubstr("no texture"));
}

TEST(RenderMesh, ReadsTheTextureAsRgbFromTheTop) {
  TriangleMesh mesh;
  mesh.texture = cv::Mat(2, 3, CV_8UC3, cv::Scalar(0, 0, 0));
  mesh.texture.at<cv::Vec3b>(0, 1) = {255, 51, 102};  // BGR
  const Tensor texture = texture_tensor(mesh);
  EXPECT_EQ(texture.sizes(), (std::vector<std::int64_t>{1, 2, 3, 3}));
  EXPECT_TRUE(test::is_near(texture[0][0][1], torch::tensor({0.4, 0.2, 1.0}), 1e-6));
  EXPECT_NEAR(texture.sum().item<float>(), 1.6f, 1e-6f);
}

TEST(RenderMesh, HalvesATextureOfMoreThan8192Squared) {
  TriangleMesh mesh;
  mesh.texture = cv::Mat(8196, 8192, CV_8UC3, cv::Scalar(51, 51, 51));
  const Tensor texture = texture_tensor(mesh);
  EXPECT_EQ(texture.sizes(), (std::vector<std::int64_t>{1, 4098, 4096, 3}));
  EXPECT_TRUE(test::is_near(texture[0][4097][4095], torch::full({3}, 0.2), 1e-6));
}

}  // namespace
}  // namespace doppel::shading_test
