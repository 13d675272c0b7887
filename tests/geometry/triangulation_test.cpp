#include "doppel/geometry/triangulation.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/ring_of_cameras.h"

namespace doppel {
namespace {

const Eigen::Vector3d kPoint(0.12, 1.3, -0.2);

std::vector<Camera> bent_cameras() {
  std::vector<Camera> cameras;
  for (Camera camera : ring_of_cameras(6, 800, {0.0, 1.0, 0.0})) {
    if (cameras.size() % 2 == 1) camera.lens = Lens::fisheye;
    camera.distortion[0] = -0.12;
    cameras.push_back(camera);
  }
  return cameras;
}

std::vector<Sight> sights_of(const std::vector<Camera>& cameras, const Eigen::Vector2d& error) {
  std::vector<Sight> sights;
  for (const Camera& camera : cameras) sights.push_back(sight_of(camera, camera.project(kPoint) + error).value());
  return sights;
}

TEST(Triangulation, FindsAPointThroughItsLenses) {
  const auto found = triangulate(sights_of(bent_cameras(), {0, 0}));
  ASSERT_TRUE(found);
  EXPECT_LT((found->position - kPoint).norm(), 1e-9);
  EXPECT_EQ(found->views, 6);
  EXPECT_LT(found->error, 1e-6);
}

TEST(Triangulation, ResidualsArePixelsAsFilmed) {
  const std::vector<Camera> cameras = bent_cameras();
  for (const Camera& camera : cameras) {
    const auto sight = sight_of(camera, camera.project(kPoint) + Eigen::Vector2d(0.4, -0.3));
    const auto residual = residual_of(sight.value(), kPoint);
    ASSERT_TRUE(residual);
    EXPECT_LT((*residual - Eigen::Vector2d(-0.4, 0.3)).norm(), 1e-3);
    EXPECT_FALSE(residual_of(*sight, camera.centre() - camera.R.row(2).transpose()));
  }
}

TEST(Triangulation, ReportsTheResidualOfEveryView) {
  std::vector<Camera> cameras = bent_cameras();
  std::vector<Sight> sights = sights_of(cameras, {0, 0});
  sights[2] = sight_of(cameras[2], cameras[2].project(kPoint) + Eigen::Vector2d(60.0, 0.0)).value();
  const TriangulationOptions options;
  const auto found = triangulate(sights, options);
  ASSERT_TRUE(found);
  EXPECT_LT((found->position - kPoint).norm(), 1e-6);
  EXPECT_EQ(found->views, 5);
  EXPECT_NEAR(found->residuals[2], 60.0, 6.0);  // the lens is taken as linear around what was seen
  EXPECT_FALSE(found->is_inlier(2, options));
  EXPECT_TRUE(found->is_inlier(3, options));
}

TEST(Triangulation, RefinementLowersTheError) {
  std::vector<Camera> cameras = bent_cameras();
  std::vector<Sight> sights;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Eigen::Vector2d error(3.0 * std::sin(2.0 * static_cast<double>(c)),
                                3.0 * std::cos(5.0 * static_cast<double>(c)));
    sights.push_back(sight_of(cameras[c], cameras[c].project(kPoint) + error).value());
  }
  sights[0].weight = 0.05;
  TriangulationOptions options;
  options.refinement_steps = 0;
  const auto cost = [&](const TriangulatedPoint& point) {
    double sum = 0.0;
    for (std::size_t i = 0; i < sights.size(); ++i) sum += sights[i].weight * point.residuals[i] * point.residuals[i];
    return sum;
  };
  const auto rough = triangulate(sights, options);
  options.refinement_steps = 5;
  const auto fine = triangulate(sights, options);
  ASSERT_TRUE(rough && fine);
  EXPECT_LT(cost(*fine), cost(*rough));
  for (int axis = 0; axis < 3; ++axis)  // a minimum: no neighbour is better
    for (const double step : {-1e-4, 1e-4}) {
      TriangulatedPoint moved = *fine;
      moved.position[axis] += step;
      for (std::size_t i = 0; i < sights.size(); ++i)
        moved.residuals[i] = residual_of(sights[i], moved.position)->norm();
      EXPECT_GT(cost(moved), cost(*fine));
    }
}

TEST(Triangulation, AViewThatIsSomewhatOffCountsLessUnderAKernel) {
  const std::vector<Camera> cameras = bent_cameras();
  std::vector<Sight> sights = sights_of(cameras, {0, 0});
  sights[2] = sight_of(cameras[2], cameras[2].project(kPoint) + Eigen::Vector2d(20.0, 0.0)).value();
  TriangulationOptions options;
  options.inlier_threshold = 40.0;
  options.refinement_steps = 12;
  const auto squares = triangulate(sights, options);
  options.kernel = 5.0;
  const auto robust = triangulate(sights, options);
  ASSERT_TRUE(squares && robust);
  const double off = (squares->position - kPoint).norm();
  EXPECT_GT(off, 1e-3);
  EXPECT_LT((robust->position - kPoint).norm(), 0.02 * off);
  EXPECT_EQ(robust->views, 6);
}

TEST(Triangulation, GivesNothingWithoutTwoViews) {
  const std::vector<Camera> cameras = bent_cameras();
  EXPECT_FALSE(triangulate({}));
  const std::vector<Sight> one{sight_of(cameras[0], {400, 400}).value()};
  EXPECT_FALSE(triangulate(one));
  const std::vector<Sight> twice{one[0], one[0]};  // parallel rays
  EXPECT_FALSE(triangulate(twice));
  EXPECT_FALSE(sight_of(cameras[0], {std::numeric_limits<double>::quiet_NaN(), 1.0}));
}

}  // namespace
}  // namespace doppel
