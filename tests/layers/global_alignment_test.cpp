#include "doppel/layers/global_alignment/global_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/script.h>

#include <Eigen/Dense>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"

namespace doppel::global_alignment_test {
namespace {

using namespace test;
using torch::Tensor;

constexpr int kCameras = 5, kLandmarks = 7;

/// People of random landmarks at known positions, seen by cameras some metres away; rays are off by `noise`.
struct Scene {
  explicit Scene(int64_t batch = 3, int64_t cameras = kCameras, double noise = 0.1, uint64_t seed = 1) {
    points = 0.5 * random_numbers({batch, kLandmarks, 3}, seed);
    position = random_numbers({batch, 3}, seed + 1);
    rays.origin = 4.0 * random_numbers({batch, cameras, 3}, seed + 2);
    const Tensor seen = (points + position.unsqueeze(1)).unsqueeze(1) - rays.origin.unsqueeze(2);
    const Tensor off = seen + noise * random_numbers({batch, cameras, kLandmarks, 3}, seed + 3);
    rays.direction = off / off.norm(2, {-1}, true);
    rays.confidence =
        torch::rand({batch, cameras, kLandmarks}, at::detail::createCPUGenerator(seed + 4), torch::kFloat64);
  }
  /// Leaves only these rays: confidence 1 there, 0 elsewhere.
  void see_only(const std::vector<std::array<int64_t, 2>>& camera_and_landmark) {
    rays.confidence.zero_();
    for (const auto& [c, m] : camera_and_landmark) rays.confidence.select(1, c).select(1, m).fill_(1.0);
  }
  Tensor points, position;
  LandmarkRays rays;
};

/// Generic weighted least squares: rows sqrt(sigma) [d]x t = sqrt(sigma) [d]x (o - p), by QR.
Eigen::Vector3d least_squares(const Scene& scene, int64_t b, double threshold, bool binary) {
  const int64_t C = scene.rays.origin.size(1);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3 * C * kLandmarks, 3);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * C * kLandmarks);
  const auto vector = [](const Tensor& x) {
    return Eigen::Vector3d(x[0].item<double>(), x[1].item<double>(), x[2].item<double>());
  };
  for (int64_t c = 0; c < C; ++c) {
    for (int64_t m = 0; m < kLandmarks; ++m) {
      const double sigma = scene.rays.confidence[b][c][m].item<double>();
      if (sigma < threshold) continue;
      const Eigen::Vector3d d = vector(scene.rays.direction[b][c][m]);
      Eigen::Matrix3d cross;
      cross << 0, -d.z(), d.y(), d.z(), 0, -d.x(), -d.y(), d.x(), 0;
      const double weight = std::sqrt(binary ? 1.0 : sigma);
      const int64_t row = 3 * (c * kLandmarks + m);
      rows.middleRows(row, 3) = weight * cross;
      right.segment(row, 3) = weight * cross * (vector(scene.rays.origin[b][c]) - vector(scene.points[b][m]));
    }
  }
  return rows.colPivHouseholderQr().solve(right);
}

/// Every sample's translation is finite and its gradient exactly zero, in both forms.
void expect_flagged(const Scene& scene, const Tensor& prior = {}) {
  for (const auto type : {torch::kFloat64, torch::kFloat32}) {
    const Tensor points = leaf(scene.points, type);
    const GlobalAlignment found = global_alignment(points, scene.rays, prior);
    EXPECT_FALSE(found.valid.any().item<bool>()) << type;
    EXPECT_TRUE(found.translation.isfinite().all().item<bool>()) << type;
    const Tensor gradient = test::gradients_of(found.translation, torch::ones_like(found.translation), {points})[0];
    EXPECT_EQ(gradient.abs().max().item<double>(), 0.0) << type;
  }
}

TEST(GlobalAlignmentReference, EqualsGenericWeightedLeastSquares) {
  const Scene scene;
  for (const bool binary : {false, true}) {
    GlobalAlignmentOptions options;
    options.binary = binary;
    const GlobalAlignment found = global_alignment(scene.points, scene.rays, {}, options);
    EXPECT_TRUE(found.valid.all().item<bool>());
    for (int64_t b = 0; b < scene.points.size(0); ++b) {
      const Eigen::Vector3d t = least_squares(scene, b, options.confidence_threshold, binary);
      EXPECT_TRUE(is_near(found.translation[b], torch::tensor({t.x(), t.y(), t.z()}, torch::kFloat64), 1e-10));
    }
  }
}

TEST(GlobalAlignmentReference, FindsThePositionWithoutNoise) {
  const Scene scene(4, kCameras, 0.0);
  EXPECT_TRUE(is_near(global_alignment(scene.points, scene.rays).translation, scene.position, 1e-12));
}

TEST(GlobalAlignmentReference, APriorDoesNotMoveWhatTheRaysDetermine) {
  const Scene scene;
  const Tensor free = global_alignment(scene.points, scene.rays).translation;
  const Tensor prior = 100.0 * random_numbers({3, 3}, 9);
  EXPECT_TRUE(torch::equal(global_alignment(scene.points, scene.rays, prior).translation, free));
}

TEST(GlobalAlignmentReference, LowConfidencesDoNotCount) {
  Scene scene, without;
  without.rays.confidence =
      torch::where(scene.rays.confidence < 0.4, torch::zeros_like(scene.rays.confidence), scene.rays.confidence);
  without.rays.direction = torch::where((scene.rays.confidence < 0.4).unsqueeze(-1),
                                        random_numbers({3, kCameras, kLandmarks, 3}, 5), scene.rays.direction);
  EXPECT_TRUE(torch::equal(global_alignment(scene.points, scene.rays).translation,
                           global_alignment(without.points, without.rays).translation));
}

TEST(GlobalAlignmentReference, OneCameraSuffices) {
  const Scene scene(2, 1, 0.0);
  LandmarkRays rays = scene.rays;
  rays.confidence = torch::ones_like(rays.confidence);
  const GlobalAlignment found = global_alignment(scene.points, rays);
  EXPECT_TRUE(found.valid.all().item<bool>());
  EXPECT_TRUE(is_near(found.translation, scene.position, 1e-9));
}

TEST(GlobalAlignmentGradient, EqualsCentralDifferences) {
  test::GradientOptions options;
  options.step = 1e-3;  // the translation is linear in the landmarks: no truncation, less rounding
  options.absolute = 1e-8;
  options.relative = 0.0;
  for (int64_t cameras : {1, 2, 5}) {
    Scene scene(3, cameras);
    scene.rays.confidence = scene.rays.confidence.clamp_min(0.5);
    EXPECT_TRUE(gradients_match([&](const auto& x) { return global_alignment(x[0], scene.rays).translation; },
                                {{"points", scene.points}}, options))
        << cameras;
  }
}

TEST(GlobalAlignmentGradient, SumsToMinusTheIdentityOverLandmarks) {
  const Scene scene;
  for (const auto type : {torch::kFloat64, torch::kFloat32}) {
    for (int64_t axis = 0; axis < 3; ++axis) {
      const Tensor points = leaf(scene.points, type);
      global_alignment(points, scene.rays).translation.select(-1, axis).sum().backward();
      Tensor expected = torch::zeros({3, 3}, torch::kFloat64);
      expected.select(1, axis).fill_(-1.0);
      EXPECT_TRUE(is_near(points.grad().sum(1), expected, type == torch::kFloat64 ? 1e-12 : 1e-6));
    }
  }
}

TEST(GlobalAlignmentAgrees, LoopsEqualReference) {
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    for (int64_t batch : {0, 1, 2, 17}) {
      const Scene scene(batch);
      const Tensor points = leaf(scene.points, torch::kFloat32), exact = leaf(points, torch::kFloat64);
      const GlobalAlignment found = global_alignment(points, scene.rays);
      const GlobalAlignment expected = global_alignment(exact, scene.rays);
      EXPECT_TRUE(is_near(found.translation, expected.translation, 1e-6, 1e-7)) << batch;
      EXPECT_TRUE(torch::equal(found.valid, expected.valid));
      const Tensor probe = random_numbers({batch, 3}, 8);
      EXPECT_TRUE(is_near(test::gradients_of(found.translation, probe, {points})[0],
                          test::gradients_of(expected.translation, probe, {exact})[0], 1e-6, 1e-6));
    }
  }
}

TEST(GlobalAlignmentAgrees, LoopsEqualReferenceWhereRaysDoNotTell) {
  Scene scene(4);
  scene.rays.confidence[0].zero_();
  scene.rays.confidence[1].zero_();
  scene.rays.confidence[1][2][3] = 0.9;
  scene.rays.confidence[2][0][0] = std::numeric_limits<double>::quiet_NaN();
  scene.points[3][1][2] = std::numeric_limits<double>::quiet_NaN();
  const Tensor prior = random_numbers({4, 3}, 6);
  const GlobalAlignment found = global_alignment(scene.points.to(torch::kFloat32), scene.rays, prior);
  const GlobalAlignment expected = global_alignment(scene.points, scene.rays, prior);
  EXPECT_TRUE(is_near(found.translation, expected.translation, 1e-5, 1e-6));
  EXPECT_TRUE(torch::equal(found.valid, torch::tensor({false, false, true, false})));
  EXPECT_TRUE(torch::equal(found.valid, expected.valid));
}

TEST(GlobalAlignmentDegenerate, WithoutRaysThePriorIsTheAnswer) {
  Scene scene;
  scene.rays.confidence *= 0.39;
  const Tensor prior = random_numbers({3, 3}, 9);
  expect_flagged(scene, prior);
  EXPECT_TRUE(is_near(global_alignment(scene.points, scene.rays, prior).translation, prior, 1e-12));
  EXPECT_TRUE(is_near(global_alignment(scene.points, scene.rays).translation, torch::zeros({3, 3}), 1e-12));
  scene.rays.confidence = torch::zeros({3, 0, kLandmarks}, torch::kFloat64);  // no camera at all
  scene.rays.origin = torch::zeros({3, 0, 3}, torch::kFloat64);
  scene.rays.direction = torch::zeros({3, 0, kLandmarks, 3}, torch::kFloat64);
  expect_flagged(scene, prior);
}

TEST(GlobalAlignmentDegenerate, OneRayGivesThePositionOnItNearestThePrior) {
  Scene scene;
  scene.see_only({{1, 4}});
  const Tensor prior = random_numbers({3, 3}, 9);
  expect_flagged(scene, prior);
  const Tensor found = global_alignment(scene.points, scene.rays, prior).translation;
  const Tensor d = scene.rays.direction.select(1, 1).select(1, 4);
  const Tensor foot = scene.rays.origin.select(1, 1) - scene.points.select(1, 4);
  const Tensor expected = foot + ((prior - foot) * d).sum(-1, true) * d;
  EXPECT_TRUE(is_near(found, expected, 1e-4));
}

TEST(GlobalAlignmentDegenerate, ParallelRaysDoNotTellTheDepth) {
  Scene scene;
  scene.see_only({{0, 1}, {0, 2}, {3, 1}});
  scene.rays.direction.zero_();
  scene.rays.direction.select(-1, 2).fill_(1.0);
  expect_flagged(scene);
}

TEST(GlobalAlignmentDegenerate, NumbersThatAreNoneDoNotSpread) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (double bad : {nan, infinity}) {
    Scene points, directions, origins, prior_only;
    points.points[0][0][0] = bad;
    directions.rays.direction[0][0][0][1] = bad;
    origins.rays.origin[0][2][1] = bad;
    prior_only.rays.confidence.zero_();
    const Tensor prior = torch::full({3, 3}, bad, torch::kFloat64);
    for (const Scene* scene : {&points, &directions, &origins, &prior_only}) {
      for (const auto type : {torch::kFloat64, torch::kFloat32}) {
        const Tensor input = leaf(scene->points, type);
        const GlobalAlignment found = global_alignment(input, scene->rays, prior);
        found.translation.sum().backward();
        EXPECT_TRUE(found.translation.isfinite().all().item<bool>());
        EXPECT_TRUE(input.grad().isfinite().all().item<bool>());
      }
    }
  }
}

TEST(KeypointRays, PassThroughThePoint) {
  // K [R|t] of a camera turned about two axes.
  const Tensor pose = test::random_transforms(2, 3, 2.0, 11);
  const Tensor K = torch::tensor({{900.0, 3.0, 310.0}, {0.0, 950.0, 250.0}, {0.0, 0.0, 1.0}}, torch::kFloat64);
  const Tensor rotation = pose.narrow(-1, 0, 3), shift = pose.select(-1, 3);
  const Tensor centre = -torch::matmul(rotation.transpose(-2, -1), shift.unsqueeze(-1)).squeeze(-1);
  const Tensor in_camera = torch::tensor({{0.3, -0.2, 3.0}, {-0.4, 0.6, 4.0}}, torch::kFloat64);  // [M,3]
  const Tensor world = torch::matmul(in_camera, rotation) + centre.unsqueeze(2);                  // R^T x + o
  const Tensor homogeneous = torch::matmul(in_camera, K.t());
  Tensor keypoints = torch::cat(
      {homogeneous.narrow(-1, 0, 2) / homogeneous.narrow(-1, 2, 1), torch::tensor({{0.5}, {0.8}}, torch::kFloat64)},
      -1);
  keypoints = keypoints.expand({2, 3, 2, 3}).clone();
  const Tensor to_world = world - centre.unsqueeze(2);
  for (double sign : {1.0, -1.0}) {  // a projection matrix is known up to a factor
    const LandmarkRays rays = keypoint_rays(keypoints, sign * torch::matmul(K, pose), centre);
    EXPECT_TRUE(is_near(rays.direction, to_world / to_world.norm(2, {-1}, true), 1e-12));
    EXPECT_TRUE(torch::equal(rays.confidence, keypoints.select(-1, 2)));
    EXPECT_TRUE(torch::equal(rays.origin, centre));
  }
  keypoints[0][1][0][0] = std::numeric_limits<double>::quiet_NaN();
  const LandmarkRays damaged = keypoint_rays(keypoints, torch::matmul(K, pose), centre);
  EXPECT_EQ(damaged.confidence[0][1][0].item<double>(), 0.0);
  EXPECT_TRUE(damaged.direction.isfinite().all().item<bool>());
  EXPECT_EQ(keypoint_rays(keypoints, torch::zeros({2, 3, 3, 4}), centre).confidence.abs().max().item<double>(), 0.0);
}

TEST(GlobalAlignmentRejects, ShapesThatDoNotFit) {
  const Scene scene;
  LandmarkRays rays = scene.rays;
  rays.confidence = rays.confidence.narrow(2, 0, 3);
  EXPECT_THAT(support::message_of<UsageError>([&] { global_alignment(scene.points, rays); }),
              testing::AllOf(testing::HasSubstr("rays.confidence"), testing::HasSubstr("[3,5,3]")));
  EXPECT_THAT(support::message_of<UsageError>([&] {
                global_alignment(scene.points, scene.rays, torch::zeros({1, 3}));
              }),
              testing::HasSubstr("prior"));
}

TEST(GlobalAlignmentRejects, ASecondDerivativeOfTheLoops) {
  const Scene scene;
  const Tensor points = leaf(scene.points, torch::kFloat32);
  const Tensor loss = global_alignment(points, scene.rays).translation.square().sum();
  const Tensor gradient = torch::autograd::grad({loss}, {points}, {}, true, /*create_graph=*/true)[0];
  EXPECT_THAT(support::message_of([&] { gradient.square().sum().backward(); }),
              testing::HasSubstr("no second derivative"));
}

}  // namespace
}  // namespace doppel::global_alignment_test
