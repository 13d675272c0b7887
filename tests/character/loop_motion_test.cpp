#include "doppel/character/loop_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/error.h"

namespace doppel::loop_motion_test {
namespace {

/// One angle whose joint turns by twice the DoF, and one translation.
Skeleton two_dofs() {
  Skeleton skeleton;
  skeleton.joints = {{"a_tx", Joint::Type::prismatic, -1, {0, 0, 0}, {1, 0, 0}},
                     {"a_ry", Joint::Type::revolute, 0, {0, 0, 0}, {0, 1, 0}}};
  skeleton.dofs = {{"tx", {{0, 1.0}}, {}}, {"ry", {{1, 2.0}}, {}}};
  return skeleton;
}

TEST(LoopMotion, TheEndRunsIntoTheStart) {
  Motion motion;
  for (int t = 0; t < 20; ++t) motion.frames.push_back({0.1 * t, 0.05 * t});
  const Motion loop = loop_motion(motion, two_dofs(), 5);
  ASSERT_EQ(loop.num_frames(), 15);
  EXPECT_EQ(loop.frames[0], motion.frames[15]);  // the frame that follows the last one
  EXPECT_EQ(loop.frames[14], motion.frames[14]);
  EXPECT_EQ(loop.frames[5], motion.frames[5]);
  EXPECT_NEAR(loop.frames[1][0], 0.8 * motion.frames[16][0] + 0.2 * motion.frames[1][0], 1e-12);
}

TEST(LoopMotion, AnglesTakeTheShortWay) {
  Motion motion;  // the joint turns by 2 * pi from start to end: no way at all
  for (int t = 0; t < 20; ++t) motion.frames.push_back({0.0, M_PI * t / 15.0});
  const Motion loop = loop_motion(motion, two_dofs(), 5);
  for (int t = 0; t < 5; ++t)
    EXPECT_NEAR(loop.frames[static_cast<std::size_t>(t)][1], M_PI * (t + 15) / 15.0, 1e-9) << t;
}

TEST(LoopMotion, AShortMotionIsRefused) {
  Motion motion;
  motion.frames.assign(10, {0.0, 0.0});
  EXPECT_THROW(loop_motion(motion, two_dofs(), 5), UsageError);
}

}  // namespace
}  // namespace doppel::loop_motion_test
