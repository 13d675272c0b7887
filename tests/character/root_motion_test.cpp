#include "doppel/character/root_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/character/loop_motion.h"

namespace doppel::root_motion_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// A root with the given order of rotations and weights that are not 1, above it an arm that swings.
Skeleton walker(const std::array<int, 3>& axes) {
  Skeleton skeleton;
  const char* names[] = {"tx", "ty", "tz", "r0", "r1", "r2", "arm"};
  for (int i = 0; i < 7; ++i) {
    const bool slides = i < 3;
    const Vector3d axis =
        slides ? Vector3d::Unit(i) : Vector3d::Unit(i < 6 ? axes[static_cast<std::size_t>(i - 3)] : 0);
    const Vector3d offset = i == 0 ? Vector3d(0.1, 0.9, -0.2) : i == 6 ? Vector3d(0.2, 0.5, 0.0) : Vector3d::Zero();
    skeleton.joints.push_back({names[i], slides ? Joint::Type::prismatic : Joint::Type::revolute, i - 1, offset, axis});
    skeleton.dofs.push_back({names[i], {{i, slides ? 0.5 : -2.0}}, {}});
  }
  return skeleton;
}

/// The DoFs of a root at `at` that faces `heading` and leans, with the arm at an angle.
std::vector<double> pose_of(const Skeleton& skeleton, const Vector3d& at, double heading, double lean, double arm) {
  const Skeleton::Root root = skeleton.root();
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(heading, Vector3d::UnitY()) * Eigen::AngleAxisd(lean, Vector3d(1, 0.2, 0.5).normalized()))
          .toRotationMatrix();
  const Vector3d angles = turn.eulerAngles(root.axes[0], root.axes[1], root.axes[2]);
  std::vector<double> dofs(7);
  for (Eigen::Index i = 0; i < 3; ++i) dofs[static_cast<std::size_t>(i)] = at[i] / 0.5;
  for (Eigen::Index i = 0; i < 3; ++i) dofs[static_cast<std::size_t>(3 + i)] = angles[i] / -2.0;
  dofs[6] = arm / -2.0;
  return dofs;
}

/// 50 frames of a walk along an arc, whose lean and arm repeat every `period` frames.
Motion walk(const Skeleton& skeleton, int period, double turn_per_frame) {
  Motion motion;
  Vector3d at(3.0, 0.0, -1.0);
  for (int t = 0; t < 50; ++t) {
    const double heading = 0.4 + turn_per_frame * t, phase = 2.0 * M_PI * t / period;
    motion.frames.push_back(pose_of(skeleton, at + Vector3d(0, 0.05 * std::cos(2 * phase), 0), heading,
                                    0.1 + 0.05 * std::sin(phase), 0.5 * std::sin(phase)));
    motion.ids.push_back(t);
    at += 0.04 * Vector3d(std::sin(heading), 0.0, std::cos(heading));
  }
  return motion;
}

/// Largest difference between the transforms of the joints of two poses, metres and radians.
double distance(const Skeleton& skeleton, const std::vector<double>& a, const std::vector<double>& b) {
  const auto first = skeleton.pose(a), second = skeleton.pose(b);
  double largest = 0.0;
  for (std::size_t j = 0; j < first.size(); ++j)
    largest = std::max(largest, (first[j].matrix() - second[j].matrix()).norm());
  return largest;
}

class RootMotion : public testing::TestWithParam<std::array<int, 3>> {
 protected:
  const Skeleton skeleton_ = walker(GetParam());
  const Skeleton::Root root_ = *root_that_travels(skeleton_);
};

TEST_P(RootMotion, APoseIsBroughtBackByTheRigidMotionOfTheStep) {
  const GroundStep step{2.5, {1.0, 2.0}, {-3.0, 0.5}};
  const std::vector<double> before = pose_of(skeleton_, {0.3, 0.2, 0.7}, -0.8, 0.3, 0.2);
  // The root's position is relative to where it is with translations 0, which is (0.1, -0.2) here.
  const Eigen::Affine3d moved = Eigen::Translation3d(-3.0 + 0.1, 0, 0.5 - 0.2) *
                                Eigen::AngleAxisd(2.5, Vector3d::UnitY()) *
                                Eigen::Translation3d(-1.0 - 0.1, 0, -2.0 + 0.2);
  const Eigen::Affine3d wanted = moved * skeleton_.pose(before)[5];
  const Eigen::Matrix3d turn = wanted.linear();
  const Vector3d angles = turn.eulerAngles(root_.axes[0], root_.axes[1], root_.axes[2]);
  std::vector<double> after = before;
  for (Eigen::Index i = 0; i < 3; ++i) {
    after[static_cast<std::size_t>(i)] = (wanted.translation() - Vector3d(0.1, 0.9, -0.2))[i] / 0.5;
    after[static_cast<std::size_t>(3 + i)] = angles[i] / -2.0;
  }
  ASSERT_LT((skeleton_.pose(after)[5].matrix() - wanted.matrix()).norm(), 1e-9);
  const std::vector<double> back = before_step(root_, after, step, before);
  EXPECT_LT(distance(skeleton_, back, before), 1e-9);
  for (std::size_t d = 0; d < 7; ++d) EXPECT_NEAR(back[d], before[d], 1e-9);  // those of `like`
}

TEST_P(RootMotion, AWalkThatRepeatsIsItsOwnLoop) {
  for (const double turn : {0.0, 0.02, -0.1}) {
    const Motion motion = walk(skeleton_, 20, turn);
    const GroundStep step = loop_step(motion, root_, 10);  // 40 frames stay: two periods
    EXPECT_NEAR(step.turn, std::remainder(40 * turn, 2 * M_PI), 1e-9);
    if (turn == 0.0) {
      EXPECT_NEAR((step.way() - 1.6 * Vector2d(std::sin(0.4), std::cos(0.4))).norm(), 0.0, 1e-9);
    }
    const Motion loop = travelling_loop(motion, skeleton_, root_, 10, step);
    ASSERT_EQ(loop.num_frames(), 40);
    for (int t = 0; t < 40; ++t)
      EXPECT_LT(
          distance(skeleton_, loop.frames[static_cast<std::size_t>(t)], motion.frames[static_cast<std::size_t>(t)]),
          1e-9)
          << t;
  }
}

TEST_P(RootMotion, ALoopGoesOnWhereItEnds) {
  const Motion motion = walk(skeleton_, 23, 0.03);  // 40 frames are no multiple of the period
  const GroundStep step = loop_step(motion, root_, 10);
  const Motion loop = travelling_loop(motion, skeleton_, root_, 10, step);
  // Frame 40, brought back, is frame 0; so the repetition goes on from frame 39 as the motion does.
  EXPECT_LT(distance(skeleton_, loop.frames[0], before_step(root_, motion.frames[40], step, motion.frames[0])), 1e-9);
  // All steps of the root, also those across the seam, are about as long as the person's.
  for (std::size_t t = 0; t + 1 < loop.frames.size(); ++t)
    EXPECT_NEAR((ground_position(root_, loop.frames[t + 1]) - ground_position(root_, loop.frames[t])).norm(), 0.04,
                0.002)
        << t;
  const Motion sliding = loop_motion(motion, skeleton_, 10);
  EXPECT_GT((ground_position(root_, sliding.frames[1]) - ground_position(root_, sliding.frames[0])).norm(), 0.1);
}

TEST_P(RootMotion, InPlaceTheRootStaysAboveOnePoint) {
  const Motion motion = walk(skeleton_, 20, 0.02), still = in_place(root_, motion);
  for (std::size_t t = 0; t < 50; ++t) {
    const Eigen::Affine3d was = skeleton_.pose(motion.frames[t])[5], is = skeleton_.pose(still.frames[t])[5];
    EXPECT_NEAR(is.translation().x(), 3.1, 1e-9);
    EXPECT_NEAR(is.translation().z(), -1.2, 1e-9);
    EXPECT_EQ(is.translation().y(), was.translation().y());
    EXPECT_TRUE(is.linear().isApprox(was.linear()));
  }
}

INSTANTIATE_TEST_SUITE_P(OrdersOfRotation, RootMotion,
                         testing::Values(std::array<int, 3>{1, 2, 0}, std::array<int, 3>{0, 1, 2},
                                         std::array<int, 3>{2, 0, 1}));

TEST(RootMotionTravels, FromAThirdOfAMetreOrAnEighthOfATurn) {
  EXPECT_FALSE(is_travel({0.5, {1.0, 1.0}, {1.2, 1.1}}));
  EXPECT_TRUE(is_travel({0.0, {1.0, 1.0}, {1.3, 1.2}}));
  EXPECT_TRUE(is_travel({-0.9, {1.0, 1.0}, {1.0, 1.0}}));
}

TEST(RootMotionTravels, OnlyARootThatSlidesAndTurns) {
  Skeleton skeleton = walker({1, 2, 0});
  EXPECT_TRUE(root_that_travels(skeleton).has_value());
  skeleton.joints[0].type = Joint::Type::revolute;
  EXPECT_FALSE(root_that_travels(skeleton).has_value());
}

}  // namespace
}  // namespace doppel::root_motion_test
