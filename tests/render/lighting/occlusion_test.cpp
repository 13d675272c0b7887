#include "doppel/render/lighting/occlusion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "support/gradient_check.h"

namespace doppel::occlusion_test {
namespace {

using torch::Tensor;

constexpr double kRadius = 0.1;  // metres, of the limb
constexpr double kBall = 0.28;   // the length of a limb that is a single ball, and still longer than wide

/// Points on a cylinder about an axis through `middle` along x. @return [M,3]
Tensor cylinder(double length, const Tensor& middle) {
  constexpr int kRings = 41, kAround = 24;
  const Tensor along = (torch::arange(kRings, torch::kFloat32) / (kRings - 1) - 0.5) * length,
               angle = torch::arange(kAround, torch::kFloat32) * (2 * M_PI / kAround);
  const Tensor x = along.view({-1, 1}).expand({kRings, kAround}),
               y = (kRadius * angle.cos()).view({1, -1}).expand({kRings, kAround}),
               z = (kRadius * angle.sin()).view({1, -1}).expand({kRings, kAround});
  return torch::stack({x, y, z}, 2).view({-1, 3}) + middle;
}

/// A limb, and one point that does not belong to it. In the rest pose they are three metres apart.
struct LimbAndPoint {
  Tensor rest, parts;
  std::int64_t point;

  explicit LimbAndPoint(double length) {
    const Tensor limb = cylinder(length, torch::tensor({0.f, 3.f, 0.f}));
    point = limb.size(0);
    rest = torch::cat({limb, torch::zeros({1, 3})});
    parts = torch::cat({torch::zeros({point}, torch::kInt64), torch::ones({1}, torch::kInt64)});
  }
  /// The vertices with the middle of the limb at `middle` and the point at the origin. @return [1,N,3]
  Tensor posed(const Tensor& middle) const {
    Tensor vertices = rest.clone();
    vertices.narrow(0, 0, point) += middle - torch::tensor({0.f, 3.f, 0.f});
    return vertices.unsqueeze(0);
  }
  Tensor normals(const Tensor& at_point) const {
    Tensor normals = torch::zeros_like(rest);
    normals[point] = at_point;
    return normals.unsqueeze(0);
  }
};

const Tensor kUp = torch::tensor({0.f, 1.f, 0.f});

TEST(BodySpheresReference, ABallTakesItsSolidAngleTimesTheCosine) {
  const LimbAndPoint scene(kBall);
  const BodySpheres spheres(scene.rest, scene.parts);
  ASSERT_EQ(spheres.size(), 1);
  for (const double angle : {0.0, 0.5, 1.2, 1.8}) {
    const double distance = 0.4;
    const Tensor direction =
        torch::tensor({static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle)), 0.f});
    const Occlusion found = spheres.at(scene.posed(distance * direction), scene.normals(kUp));
    const double expected = std::pow(kRadius / distance, 2) * std::max(std::cos(angle), 0.0);
    EXPECT_NEAR(found.amount[0][scene.point].item<double>(), expected, 1e-4) << angle;
    if (expected > 0) {
      EXPECT_TRUE(test::is_near(found.direction[0][scene.point], direction, 1e-4)) << angle;
    }
  }
}

/// The share of uniform light at the origin, with the normal up, that a cylinder along x takes: by rays.
double share_by_rays(double length, double height) {
  auto generator = at::detail::createCPUGenerator(4);
  const std::int64_t rays = 400'000;
  const Tensor u = torch::rand({rays}, generator), phi = torch::rand({rays}, generator) * (2 * M_PI);
  const Tensor flat = u.sqrt(), up = (1 - u).sqrt();  // the density of a cosine
  const Tensor x = flat * phi.cos(), z = flat * phi.sin();
  // |t (up, z) - (height, 0)| = radius, at the nearer crossing within the length.
  const Tensor a = up * up + z * z, b = up * height, root = b * b - a * (height * height - kRadius * kRadius);
  const Tensor t = (b - root.clamp_min(0.0).sqrt()) / a;
  return ((root > 0) & ((t * x).abs() < length / 2)).to(torch::kFloat64).mean().item<double>();
}

TEST(BodySpheresReference, ALimbTakesTheLightThatRaysMeet) {
  const double length = 1.0;
  const LimbAndPoint scene(length);
  const BodySpheres spheres(scene.rest, scene.parts);
  EXPECT_EQ(spheres.size(), 5);
  for (const double height : {0.2, 0.3, 0.6}) {
    const double expected = share_by_rays(length, height);
    const Occlusion found =
        spheres.at(scene.posed(torch::tensor({0.f, static_cast<float>(height), 0.f})), scene.normals(kUp));
    // The balls leave gaps at their sides, where a row of discs covers pi/4 of its strip; near the limb, a ball covers
    // more of the sky than its disc.
    EXPECT_NEAR(found.amount[0][scene.point].item<double>() / expected, 0.9, 0.2) << height;
  }
}

TEST(BodySpheresReference, WhatIsNearInTheGivenPoseStaysInTheLight) {
  const LimbAndPoint scene(kBall);
  for (const auto& [distance, share] : {std::pair{0.149, 0.0}, std::pair{0.175, 0.5}, std::pair{0.201, 1.0}}) {
    const Tensor near = scene.posed(torch::tensor({0.f, static_cast<float>(distance), 0.f}));
    const Occlusion found = BodySpheres(near[0], scene.parts).at(near, scene.normals(kUp));
    EXPECT_NEAR(found.amount[0][scene.point].item<double>(), share * std::pow(kRadius / distance, 2), 0.01) << distance;
  }
}

TEST(BodySpheresReference, AStraightLimbDoesNotShadeItself) {
  const LimbAndPoint scene(1.0);
  Tensor outward = scene.rest.clone();  // away from the axis of the limb
  outward.select(1, 0).zero_();
  outward.select(1, 1) -= 3.0;
  const Occlusion found = BodySpheres(scene.rest, scene.parts).at(scene.rest.unsqueeze(0), outward.unsqueeze(0));
  EXPECT_EQ(found.amount.narrow(1, 0, scene.point).max().item<double>(), 0.0);
}

TEST(BodySpheresReference, PartsTooSmallForASphereShadeNothing) {
  const Tensor vertices = torch::rand({9, 3}, at::detail::createCPUGenerator(2)),
               parts = torch::arange(9, torch::kInt64).div(3, "floor") * 2;  // of three vertices; 1 and 3 have none
  const BodySpheres spheres(vertices, parts);
  EXPECT_EQ(spheres.size(), 0);
  const Occlusion found = spheres.at(vertices.unsqueeze(0), kUp.expand({1, 9, 3}));
  EXPECT_TRUE(torch::equal(found.amount, torch::zeros({1, 9})));
  EXPECT_TRUE(torch::equal(found.direction, torch::zeros({1, 9, 3})));
}

TEST(ShadedLightReference, UniformLightLosesTheAmount) {
  const Tensor random = torch::randn({1, 50, 3}, at::detail::createCPUGenerator(1)),
               normals = random / random.norm(2, 2, true);
  const Occlusion occlusion{torch::full({1, 50}, 0.3), normals.roll(1, 1)};
  const Tensor light = shaded_light(normals, occlusion, identity_lighting(), torch::ones({1}));
  EXPECT_TRUE(test::is_near(light, torch::full({1, 50, 3}, 0.7), 1e-5));
  EXPECT_TRUE(test::is_near(
      shaded_light(normals, {torch::full({1, 50}, 0.9), normals}, identity_lighting(), torch::full({1}, 9.0)),
      torch::full({1, 50, 3}, 0.1), 1e-5));
}

TEST(ShadedLightReference, TheLightOfADirectionIsThatOfLambertsLawUndone) {
  // Light of the first band from above, R(m) = y: Lambert's law makes 2/3 y of it, and a small ball above takes o
  // R(up).
  Tensor lighting = torch::zeros({3, kShBasis});
  lighting.select(1, 0).fill_(1.0);
  lighting.select(1, 1).fill_(2.0 / 3.0);
  const Tensor up = kUp.view({1, 1, 3});
  const Tensor light = shaded_light(up, {torch::full({1, 1}, 0.1), up}, lighting, torch::ones({1}));
  EXPECT_TRUE(test::is_near(light, torch::full({1, 1, 3}, 1.0 + 2.0 / 3.0 - 0.1 * 2.0), 1e-5));
}

TEST(BodySpheresRejects, WrongShapes) {
  EXPECT_THROW(BodySpheres(torch::zeros({5, 2}), torch::zeros({5}, torch::kInt64)), UsageError);
  EXPECT_THROW(BodySpheres(torch::zeros({5, 3}), torch::zeros({4}, torch::kInt64)), UsageError);
}

}  // namespace
}  // namespace doppel::occlusion_test
