#include "doppel/track/livecap/motion_filter.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"

namespace doppel::motion_filter_test {
namespace {

using Eigen::MatrixXd;

/// Measures one DoF of the test character, of which all others are known.
struct Setting {
  Character character = make_test_character(4);
  std::vector<int> dofs = all_dofs(character);
  PoseModel model{character, tube_landmarks(4), dofs};
  MotionOptions options{100.0, 100.0};

  std::vector<double> pose(double amount) const {
    std::vector<double> result = character.rest_dofs;
    result[6] += amount;
    return result;
  }
  MatrixXd measured(double weight) const {
    return weight * MatrixXd::Identity(model.num_unknowns(), model.num_unknowns());
  }
};

TEST(MotionFilter, BeginsAtRest) {
  const Setting s;
  MotionFilter filter(s.options);
  EXPECT_TRUE(filter.empty());
  filter.start(s.model, s.pose(0.3), s.measured(4.0));
  ASSERT_FALSE(filter.empty());
  const auto next = filter.predicted(s.model);
  EXPECT_NEAR(next.dofs[6], s.pose(0.3)[6], 1e-12);
  EXPECT_GT(next.covariance(0, 0), 0.25);  // the first pose's own variance, and that of its unknown velocity
  filter.clear();
  EXPECT_TRUE(filter.empty());
}

/// The filter of one number, written out: the covariance of (x, v) under the same equations.
TEST(MotionFilter, IsTheKalmanFilterOfEachUnknown) {
  const Setting s;
  MotionFilter filter(s.options);
  filter.start(s.model, s.pose(0.0), s.measured(4.0));
  const double noise = 1.0 / (100.0 * std::pow(s.model.reach(6), 2));
  Eigen::Vector2d state(0.0, 0.0);
  Eigen::Matrix2d covariance;
  covariance << 0.25, 0.0, 0.0, 900.0 * noise;
  for (const double measurement : {0.1, 0.25, 0.2, 0.4}) {
    Eigen::Matrix2d step;
    step << 1.0, 1.0, 0.0, 1.0;
    state = step * state;
    covariance = step * covariance * step.transpose() + noise * Eigen::Matrix2d::Ones();
    const auto next = filter.predicted(s.model);
    int unknown = 0;
    while (s.model.dof_of(unknown) != 6) ++unknown;
    ASSERT_NEAR(next.dofs[6] - s.character.rest_dofs[6], state[0], 1e-9);
    ASSERT_NEAR(next.covariance(unknown, unknown), covariance(0, 0), 1e-9);
    // The fit of the frame: the minimum of prediction and measurement, and half the second derivative there.
    const MatrixXd hessian = next.covariance.inverse() + s.measured(4.0);
    const Eigen::Vector2d gain = covariance.col(0) / (covariance(0, 0) + 0.25);
    state += gain * (measurement - state[0]);
    covariance -= (gain * covariance.row(0)).eval();
    filter.add(s.model, s.pose(state[0]), hessian);
  }
}

TEST(MotionFilter, FollowsASteadyMotionWithoutLag) {
  const Setting s;
  MotionFilter filter(s.options);
  filter.start(s.model, s.pose(0.0), s.measured(1.0));
  for (int frame = 1; frame < 60; ++frame) {
    const auto next = filter.predicted(s.model);
    if (frame > 50) {
      EXPECT_NEAR(next.dofs[6], s.pose(0.02 * frame)[6], 1e-3);
    }
    filter.add(s.model, s.pose(0.02 * frame), next.covariance.inverse() + s.measured(1.0));
  }
}

}  // namespace
}  // namespace doppel::motion_filter_test
