#include "doppel/render/rays/guided_sampling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "geometry/meshes.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::guided_sampling_test {
namespace {

using support::message_of;
using test::gradients_match;
using test::is_near;
using torch::Tensor;

constexpr int kHeight = 40, kWidth = 56;
constexpr double kRadius = 0.5, kAway = 3.0;

/// A sphere around the origin, seen from z = -3 by a camera that is turned a little.
struct Scene {
  TriangleMesh mesh = support::make_sphere(3, kRadius);
  Tensor vertices, faces, projection;
  Camera camera;
  explicit Scene(double away = kAway) {
    vertices = torch::empty({mesh.num_vertices(), 3}, torch::kFloat64);
    for (int i = 0; i < mesh.num_vertices(); ++i)
      for (int k = 0; k < 3; ++k) vertices[i][k] = mesh.vertices[i][k];
    faces = torch::empty({mesh.num_faces(), 3}, torch::kInt64);
    for (int f = 0; f < mesh.num_faces(); ++f)
      for (int k = 0; k < 3; ++k) faces[f][k] = mesh.faces[f][k];
    camera.width = kWidth;
    camera.height = kHeight;
    camera.K << 70, 0, 26, 0, 75, 22, 0, 0, 1;
    camera.R = Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    camera.t = -camera.R * Eigen::Vector3d(0, 0, -away);
    projection = projection_tensor({PinholeCamera(camera)}, torch::kFloat64)[0];
  }
  Tensor batch() const { return vertices.to(torch::kFloat32).unsqueeze(0); }
  Tensor cameras() const { return projection.to(torch::kFloat32).view({1, 1, 3, 4}); }
  GuideImages guide(const GuideOptions& options = {}) const {
    Rasterizer rasterizer(faces);
    return guide_images(rasterizer, faces, batch(), cameras(), kHeight, kWidth, options);
  }
};

Tensor all_pixels() {
  const Tensor y = torch::arange(kHeight).view({-1, 1}).expand({kHeight, kWidth});
  const Tensor x = torch::arange(kWidth).view({1, -1}).expand({kHeight, kWidth});
  return torch::stack({x.flatten(), y.flatten()}, 1);
}

TEST(PixelRays, GoThroughTheCentresOfPixels) {
  const Scene scene;
  const Tensor pixels = all_pixels();
  const PixelRays rays = pixel_rays(scene.projection, pixels);
  EXPECT_TRUE(is_near(rays.direction.norm(2, {1}), torch::ones({pixels.size(0)}), 1e-12));
  const Tensor points = (rays.origin + 2.5 * rays.direction).unsqueeze(0);
  const Tensor seen = project(points, scene.projection.view({1, 1, 3, 4}))[0][0];
  EXPECT_TRUE(is_near(seen, pixels.to(torch::kFloat64) + 0.5, 1e-9));
  const Eigen::Vector3d centre = scene.camera.centre();
  EXPECT_TRUE(is_near(rays.origin, torch::tensor({centre.x(), centre.y(), centre.z()}, torch::kFloat64), 1e-12));
}

// Distances of the surface along rays, by ray and sphere; its faces lie a little inside.
TEST(GuideImages, DistanceIsAlongTheRay) {
  const Scene scene;
  const GuideImages guide = scene.guide();
  const Tensor pixels = all_pixels();
  const PixelRays rays = pixel_rays(scene.projection, pixels);
  const Tensor along = -(rays.origin * rays.direction).sum(1);
  const Tensor chord = kRadius * kRadius - ((rays.origin + along.unsqueeze(1) * rays.direction).square().sum(1));
  const Tensor expected = along - chord.clamp_min(0).sqrt();
  const Tensor well_inside = (chord > 0.5 * kRadius * kRadius).nonzero().squeeze(1);
  EXPECT_GT(well_inside.size(0), 100);
  EXPECT_TRUE(
      is_near(guide.distance.flatten().index_select(0, well_inside), expected.index_select(0, well_inside), 0.012));
  EXPECT_TRUE(torch::isinf(guide.distance.flatten().masked_select(chord < 0)).all().item<bool>());
}

// Least and largest distance of the stencil, whether or not the pixel itself shows the mesh.
TEST(GuidedInterval, ErodesAndDilatesWithTheRightBackground) {
  const Scene scene;
  const GuideOptions options{0.03, 0.05, 5};
  const GuideImages guide = scene.guide(options);
  const Tensor pixels = all_pixels();
  const RayInterval interval =
      guided_interval(guide, 0, pixels, scene.faces, scene.vertices, scene.projection, options);
  const auto distance = guide.distance.accessor<float, 3>();
  int beside = 0;
  for (int64_t r = 0; r < pixels.size(0); ++r) {
    const int64_t x = r % kWidth, y = r / kWidth;
    double least = 1e9, largest = 0.0;
    for (int64_t j = std::max<int64_t>(0, y - 2); j <= std::min<int64_t>(kHeight - 1, y + 2); ++j)
      for (int64_t i = std::max<int64_t>(0, x - 2); i <= std::min<int64_t>(kWidth - 1, x + 2); ++i) {
        if (std::isinf(distance[0][j][i])) continue;
        least = std::min<double>(least, distance[0][j][i]);
        largest = std::max<double>(largest, distance[0][j][i]);
      }
    const double near = interval.near[r].item<double>(), far = interval.far[r].item<double>();
    EXPECT_EQ(guide.reached[0][y][x].item<bool>(), largest > 0);
    if (largest > 0) {
      EXPECT_NEAR(near, least - 0.03, 2e-3);
      EXPECT_NEAR(far, largest + 0.05, 5e-3);  // on the outline faces are seen at a flat angle
      beside += std::isinf(distance[0][y][x]);
    } else {
      EXPECT_EQ(near, 0.0);
      EXPECT_EQ(far, 0.0);
    }
  }
  EXPECT_GT(beside, 20);
  EXPECT_EQ(guide.pixels(0).size(0), guide.reached.sum().item<int64_t>());
}

TEST(GuidedInterval, GradientToTheVertices) {
  const Scene scene;
  const GuideImages guide = scene.guide();
  const Tensor pixels = guide.pixels(0).slice(0, 0, c10::nullopt, 3);
  EXPECT_TRUE(gradients_match(
      [&](const std::vector<Tensor>& in) {
        const RayInterval interval = guided_interval(guide, 0, pixels, scene.faces, in[0], scene.projection);
        return torch::cat({interval.near, interval.far});
      },
      {{"vertices", scene.vertices}}, {1e-7, 1e-6, 1e-5}));
  // Along the ray the interval goes with the mesh.
  Tensor vertices = scene.vertices.clone().requires_grad_();
  const Tensor middle = torch::tensor({{26, 22}}, torch::kInt64);
  guided_interval(guide, 0, middle, scene.faces, vertices, scene.projection).near.sum().backward();
  const Tensor direction = pixel_rays(scene.projection, middle).direction[0];
  EXPECT_NEAR((vertices.grad().sum(0) * direction).sum().item<double>(), 1.0, 0.1);
}

// Close to the camera nothing behind it is sampled.
TEST(GuidedInterval, StartsAtTheCamera) {
  const Scene scene(0.53);
  const GuideImages guide = scene.guide();
  const RayInterval interval =
      guided_interval(guide, 0, guide.pixels(0), scene.faces, scene.vertices, scene.projection);
  EXPECT_EQ(interval.near.min().item<double>(), 0.0);
  EXPECT_TRUE((interval.far > interval.near).all().item<bool>());
}

TEST(GuideImages, RejectACameraInsideTheMesh) {
  const Scene scene(0.2);
  EXPECT_THAT(message_of<Error>([&] { scene.guide(); }),
              testing::HasSubstr("camera 0 of item 0 stands inside the mesh"));
  EXPECT_THAT(message_of<UsageError>([&] { Scene().guide({0.04, 0.04, 4}); }), testing::HasSubstr("must be odd"));
  EXPECT_THAT(message_of<UsageError>([&] { Scene().guide({0.0, 0.04, 9}); }), testing::HasSubstr("greater than 0"));
}

TEST(GuideImages, OutOfViewNothingIsReached) {
  Scene scene;
  scene.vertices += 50.0;
  const GuideImages guide = scene.guide();
  EXPECT_EQ(guide.pixels(0).size(0), 0);
  const RayInterval interval = guided_interval(guide, 0, all_pixels(), scene.faces, scene.vertices, scene.projection);
  EXPECT_EQ(interval.far.abs().max().item<double>(), 0.0);
  EXPECT_THAT(message_of<Error>([&] {
                draw_pixels(guide, 0, torch::ones({kHeight, kWidth}), 10, 0.5, at::detail::createCPUGenerator(1));
              }),
              testing::HasSubstr("not seen in view 0"));
}

TEST(DrawPixels, AShareOfThemInTheMask) {
  const Scene scene;
  const GuideImages guide = scene.guide();
  Tensor mask = torch::zeros({kHeight, kWidth});
  mask.slice(1, 0, 26).fill_(1);  // the left half
  mask.slice(0, 0, 16).fill_(0);  // without its top: the mask is less than half of the drawing
  const double of_reached = mask.masked_select(guide.reached[0]).mean().item<double>();
  ASSERT_GT(of_reached, 0.1);
  ASSERT_LT(of_reached, 0.5);
  for (const double share : {0.0, 0.5, 1.0}) {
    const auto draw = [&](uint64_t seed) {
      return draw_pixels(guide, 0, mask, 2001, share, at::detail::createCPUGenerator(seed));
    };
    const Tensor pixels = draw(1), position = pixels.select(1, 1) * kWidth + pixels.select(1, 0);
    EXPECT_EQ(pixels.size(0), 2001);
    EXPECT_TRUE(guide.reached.flatten().index_select(0, position).all().item<bool>());
    const double within = mask.flatten().index_select(0, position).mean().item<double>();
    EXPECT_NEAR(within, share + (1.0 - share) * of_reached, 0.04) << share;
    EXPECT_TRUE(torch::equal(pixels, draw(1)));
    const Tensor nobody = torch::zeros({kHeight, kWidth});
    EXPECT_EQ(draw_pixels(guide, 0, nobody, 8, share, at::detail::createCPUGenerator(1)).size(0), 8);
  }
}

TEST(GuidedInterval, RejectsPixelsOutside) {
  const Scene scene;
  const GuideImages guide = scene.guide();
  EXPECT_THAT(message_of<UsageError>([&] {
                guided_interval(guide, 0, torch::tensor({{kWidth, 3}}, torch::kInt64), scene.faces, scene.vertices,
                                scene.projection);
              }),
              testing::HasSubstr("outside the image of 56 x 40"));
}

}  // namespace
}  // namespace doppel::guided_sampling_test
