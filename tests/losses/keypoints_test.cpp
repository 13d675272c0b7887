#include "doppel/losses/keypoints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/losses/limits.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"

namespace doppel::keypoints_test {
namespace {

using namespace test;
using ::testing::HasSubstr;
using torch::Tensor;

const double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

/// Two images of landmarks about 4 m away; camera 1 looks from the other side.
struct Scene {
  Scene() {
    const Tensor K = torch::tensor({{500.0, 0.0, 256.0}, {0.0, 500.0, 200.0}, {0.0, 0.0, 1.0}}, torch::kFloat64);
    const Tensor front =
        torch::tensor({{1.0, 0.0, 0.0, 0.0}, {0.0, -1.0, 0.0, 0.0}, {0.0, 0.0, -1.0, 4.0}}, torch::kFloat64);
    const Tensor back =
        torch::tensor({{-1.0, 0.0, 0.0, 0.0}, {0.0, -1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 5.0}}, torch::kFloat64);
    target.projection = torch::matmul(K, torch::stack({front, back})).expand({3, 2, 3, 4});
    points = 0.5 * random_numbers({3, 5, 3}, 1);
    const Tensor pixels = projected(points) + 10.0 * random_numbers({3, 2, 5, 2}, 2);
    const Tensor confidence = 0.5 + 0.5 * torch::rand({3, 2, 5, 1}, at::detail::createCPUGenerator(3), torch::kFloat64);
    target.keypoints = torch::cat({pixels, confidence}, -1);
    target.scale = torch::tensor({2.0, 1.0}, torch::kFloat64).expand({3, 2});
  }
  Tensor projected(const Tensor& at) const {
    const Tensor x = torch::matmul(at.unsqueeze(1), target.projection.narrow(-1, 0, 3).transpose(-2, -1)) +
                     target.projection.select(-1, 3).unsqueeze(2);
    return x.narrow(-1, 0, 2) / x.narrow(-1, 2, 1);
  }
  Tensor points;
  KeypointTarget target;
};

TEST(KeypointLoss, IsTheWeightedSumOfSquaredPixels) {
  const Scene scene;
  const Tensor lambda = torch::tensor({3.0, 1.0, 2.0, 1.0, 0.5});
  const Tensor squared = (scene.projected(scene.points) - scene.target.keypoints.narrow(-1, 0, 2)).square().sum(-1);
  const Tensor factor = scene.target.scale.square().unsqueeze(-1) * scene.target.keypoints.select(-1, 2);
  EXPECT_TRUE(is_near(keypoint_loss(scene.points, scene.target), (factor * squared).sum() / 6.0, 1e-9));
  EXPECT_TRUE(
      is_near(keypoint_loss(scene.points, scene.target, lambda), (lambda * factor * squared).sum() / 6.0, 1e-9));
  EXPECT_TRUE(is_near(keypoint_loss(scene.points.to(torch::kFloat32), scene.target),
                      keypoint_loss(scene.points, scene.target), 0.0, 1e-4));
  EXPECT_TRUE(is_near(keypoint_error(scene.points, scene.target),
                      (scene.target.scale.unsqueeze(-1) * squared.sqrt()).mean(), 1e-9));
}

TEST(KeypointLoss, OfPerfectLandmarksIsZeroAtAnyResolution) {
  Scene scene;
  scene.target.keypoints.narrow(-1, 0, 2).copy_(scene.projected(scene.points));
  EXPECT_NEAR(keypoint_loss(scene.points, scene.target).item<double>(), 0.0, 1e-20);
  // The same image at half the size: pixels halve, the scale doubles, the loss stays.
  Scene half, whole;
  half.target.projection = half.target.projection.clone();
  half.target.projection.narrow(-2, 0, 2) *= 0.5;
  half.target.keypoints.narrow(-1, 0, 2) *= 0.5;
  half.target.scale = 2.0 * half.target.scale;
  EXPECT_TRUE(is_near(keypoint_loss(half.points, half.target), keypoint_loss(whole.points, whole.target), 0.0, 1e-12));
}

TEST(KeypointLoss, LeavesOutWhatIsNotSeen) {
  Scene scene;
  scene.target.keypoints.select(0, 1).select(0, 0).select(-1, 2).fill_(0.39);  // one camera sees nothing
  scene.target.keypoints[0][0][2] = torch::tensor({kNan, 0.0, 0.0}, torch::kFloat64);
  const Tensor squared = (scene.projected(scene.points) - scene.target.keypoints.narrow(-1, 0, 2)).square().sum(-1);
  const Tensor sigma =
      torch::where(scene.target.keypoints.select(-1, 2) < 0.4, 0.0, scene.target.keypoints.select(-1, 2));
  const Tensor terms = torch::nan_to_num(sigma * scene.target.scale.square().unsqueeze(-1) * squared);
  EXPECT_TRUE(is_near(keypoint_loss(scene.points, scene.target), terms.sum() / 5.0, 1e-9));
}

TEST(KeypointLoss, APointThatWasNotDetectedHasNoErrorAtAnyThreshold) {
  Scene scene;
  scene.target.keypoints = scene.target.keypoints.clone();
  scene.target.keypoints.select(2, 4).zero_();  // at pixel (0, 0), as detectors write it
  KeypointLossOptions low, none;
  low.confidence_threshold = 1e-9;
  none.confidence_threshold = 0.0;
  EXPECT_EQ(keypoint_error(scene.points, scene.target, none).item<double>(),
            keypoint_error(scene.points, scene.target, low).item<double>());
}

TEST(KeypointLoss, NeverGivesNumbersThatAreNone) {
  for (double bad : {kNan, kInfinity, 0.0}) {
    for (const auto type : {torch::kFloat32, torch::kFloat64}) {
      Scene scene;
      scene.points[0][0].fill_(bad);
      scene.points[1][1] = torch::tensor({0.0, 0.0, 4.0}, torch::kFloat64);     // in the middle of camera 0
      scene.points[1][2] = torch::tensor({0.3, 0.0, 9.0}, torch::kFloat64);     // behind it
      scene.points[2][3] = torch::tensor({0.3, 0.0, 3.9999}, torch::kFloat64);  // almost in it
      scene.target.keypoints[0][1][1].fill_(bad);
      const Tensor points = scene.points.to(type).requires_grad_();
      const Tensor loss = keypoint_loss(points, scene.target);
      loss.backward();
      EXPECT_TRUE(loss.isfinite().item<bool>());
      EXPECT_LT(loss.item<double>(), 1e6);
      EXPECT_TRUE(points.grad().isfinite().all().item<bool>());
    }
  }
}

TEST(KeypointLoss, WithoutDetectionsIsZeroWithAZeroGradient) {
  Scene scene;
  scene.target.keypoints.zero_();
  const Tensor points = scene.points.clone().requires_grad_();
  const Tensor loss = keypoint_loss(points, scene.target);
  loss.backward();
  EXPECT_EQ(loss.item<double>(), 0.0);
  EXPECT_EQ(points.grad().abs().max().item<double>(), 0.0);
  EXPECT_EQ(keypoint_error(scene.points, scene.target).item<double>(), 0.0);
}

TEST(KeypointLoss, ALandmarkBehindTheCameraIsAsFarOffAsTheImageIsWide) {
  const Scene scene;
  Tensor points = scene.points.clone();
  const double all_in_front = keypoint_error(points, scene.target).item<double>();
  points.fill_(kNan);
  EXPECT_EQ(keypoint_error(points, scene.target).item<double>(), 1024.0);
  points.copy_(scene.points);
  points[0][0].fill_(kNan);
  EXPECT_GT(keypoint_error(points, scene.target).item<double>(), all_in_front);
  EXPECT_LT(keypoint_error(points, scene.target).item<double>(), 1024.0);
}

TEST(KeypointLoss, GradientEqualsCentralDifferences) {
  const Scene scene;
  const Tensor lambda = torch::tensor({3.0, 1.0, 2.0, 1.0, 0.5});
  test::GradientOptions options;
  options.absolute = 1e-4;  // of gradients of about 1e4
  EXPECT_TRUE(gradients_match([&](const auto& x) { return keypoint_loss(x[0], scene.target, lambda); },
                              {{"points", scene.points}}, options));
}

TEST(KeypointLoss, RejectsShapesThatDoNotFit) {
  Scene scene;
  EXPECT_THAT(support::message_of<UsageError>([&] { keypoint_loss(scene.points, scene.target, torch::ones({4})); }),
              HasSubstr("lambda"));
  scene.target.scale = torch::ones({3, 1});
  EXPECT_THAT(support::message_of<UsageError>([&] { keypoint_loss(scene.points, scene.target); }), HasSubstr("scale"));
}

TEST(LandmarkWeights, FavourTheTorsoInTheFirstThird) {
  const std::vector<std::string> names{"nose",    "neck",   "left_shoulder", "RShoulder",
                                       "mid_hip", "LElbow", "right_knee",    "wrist"};
  EXPECT_TRUE(
      torch::equal(landmark_weights(names, 0.0), torch::tensor({1.0f, 3.0f, 3.0f, 3.0f, 3.0f, 2.0f, 2.0f, 1.0f})));
  EXPECT_TRUE(torch::equal(landmark_weights(names, 0.33), landmark_weights(names, 0.0)));
  EXPECT_TRUE(torch::equal(landmark_weights(names, 0.34), torch::full({8}, 3.0f)));
  EXPECT_TRUE(torch::equal(landmark_weights(names, 1.0), torch::full({8}, 3.0f)));
}

TEST(LimitsLoss, IsTheSquaredExcess) {
  const Tensor lower = torch::tensor({-1.0, -kInfinity, -0.5}, torch::kFloat64),
               upper = torch::tensor({1.0, kInfinity, 0.5}, torch::kFloat64);
  const Tensor theta = torch::tensor({{1.5, 100.0, 0.4}, {-3.0, -100.0, 0.75}}, torch::kFloat64);
  EXPECT_NEAR(limits_loss(theta, lower, upper).item<double>(), (0.25 + 4.0 + 0.0625) / 2.0, 1e-15);
  EXPECT_EQ(limits_loss(torch::zeros({4, 3}), lower, upper).item<double>(), 0.0);
  EXPECT_EQ(limits_loss(torch::zeros({0, 3}), lower, upper).item<double>(), 0.0);
  EXPECT_TRUE(gradients_match([&](const auto& x) { return limits_loss(x[0], lower, upper); }, {{"theta", theta}}));
}

}  // namespace
}  // namespace doppel::keypoints_test
