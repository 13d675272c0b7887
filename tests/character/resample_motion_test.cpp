#include "doppel/character/resample_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel::resample_motion_test {
namespace {

/// A translation, and an angle whose joint turns by twice the DoF: once around is pi.
Skeleton slide_and_turn() {
  Skeleton skeleton;
  skeleton.joints = {{"a_tx", Joint::Type::prismatic, -1, {0, 0, 0}, {1, 0, 0}},
                     {"a_ry", Joint::Type::revolute, 0, {0, 0, 0}, {0, 1, 0}}};
  skeleton.dofs = {{"tx", {{0, 1.0}}, {}}, {"ry", {{1, 2.0}}, {}}};
  return skeleton;
}

Motion rows(std::vector<std::vector<double>> frames) {
  Motion motion;
  motion.frames = std::move(frames);
  return motion;
}

TEST(ResampleMotion, IsLinearAndKeepsTheFramesThatTheRatesShare) {
  const Motion motion = rows({{0.0, 0.0}, {1.0, 0.2}, {4.0, 0.1}});
  const Motion fast = resample(motion, slide_and_turn(), 0.25);
  ASSERT_EQ(fast.num_frames(), 9);
  EXPECT_EQ(fast.ids.back(), 8);
  for (int t = 0; t < 3; ++t) EXPECT_EQ(fast.frames[as_size(4 * t)], motion.frames[as_size(t)]);
  EXPECT_NEAR(fast.frames[5][0], 1.75, 1e-12);
  EXPECT_NEAR(fast.frames[5][1], 0.175, 1e-12);
  const Motion slow = resample(fast, slide_and_turn(), 4.0);
  EXPECT_EQ(slow.frames, motion.frames);
  EXPECT_EQ(resample(motion, slide_and_turn(), 1.5).num_frames(), 2);
}

TEST(ResampleMotion, AnglesTakeTheShortWay) {
  const Motion fast = resample(rows({{0.0, 0.45 * M_PI}, {0.0, -0.45 * M_PI}}), slide_and_turn(), 0.5);
  EXPECT_NEAR(fast.frames[1][1], 0.5 * M_PI, 1e-12);  // the joint goes on through half a turn
}

TEST(ResampleMotion, WhereAnglesJumpTheNearerFrameIsTaken) {
  const Motion motion = rows({{0.0, 0.0}, {1.0, 0.4 * M_PI}});  // the joint turns by 144 degrees
  const Motion fast = resample(motion, slide_and_turn(), 0.25);
  EXPECT_EQ(fast.frames[1], motion.frames[0]);
  EXPECT_EQ(fast.frames[3], motion.frames[1]);
}

TEST(ResampleMotion, StandsStillOutsideItsTime) {
  const Motion motion = rows({{1.0, 0.1}, {2.0, 0.2}});
  const std::vector<double> turns = full_turns(slide_and_turn());
  EXPECT_EQ(dofs_at(motion, turns, -3.0), motion.frames[0]);
  EXPECT_EQ(dofs_at(motion, turns, 7.5), motion.frames[1]);
}

TEST(ResampleMotion, RefusesImpossibleSteps) {
  const Motion motion = rows({{0.0, 0.0}, {1.0, 0.0}});
  EXPECT_THROW(resample(motion, slide_and_turn(), 0.0), UsageError);
  EXPECT_THROW(resample(motion, slide_and_turn(), std::nan("")), UsageError);
  EXPECT_THROW(resample(motion, slide_and_turn(), 1e-7), UsageError);
}

}  // namespace
}  // namespace doppel::resample_motion_test
