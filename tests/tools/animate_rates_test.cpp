#include "animate_rates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace doppel::animate_rates_test {
namespace {

using namespace tools;

TEST(AnimateRates, RetargetedMotionsAreReadFinelyWhereTheTrainingDoesNotDivideTheResult) {
  struct Row {
    double training, result, expected;
  };
  const std::vector<Row> table{{0, 0, 0},      {0, 60, 60},    {25, 25, 25},    {25, 50, 50},    {25, 100, 100},
                               {25, 60, 120},  {25, 30, 120},  {25, 10, 100},   {25, 5, 100},    {25, 110, 110},
                               {25, 990, 990}, {400, 60, 960}, {30, 12.5, 125}, {25, 1000, 1000}};
  for (const Row& row : table)
    EXPECT_DOUBLE_EQ(reading_rate({0.0, row.training, row.result}), row.expected) << row.training << " " << row.result;
}

TEST(AnimateRates, StepsAreInFramesOfTheMotionThatWasRead) {
  struct Row {
    Rates rates;
    double motion, result, frame, window;
  };
  const std::vector<Row> table{{{25, 25, 60}, 25, 60, 25.0 / 60, 1},  // the rows as they are
                               {{50, 25, 25}, 50, 25, 2, 2},
                               {{0, 25, 60}, 120, 60, 2, 4.8},  // retargeted
                               {{0, 0, 60}, 60, 60, 1, 1}};     // skinning has no windows
  for (const Row& row : table) {
    const FrameSteps steps = frame_steps(row.rates, row.motion, row.result);
    EXPECT_DOUBLE_EQ(steps.frame, row.frame) << row.motion;
    EXPECT_DOUBLE_EQ(steps.window, row.window) << row.motion;
  }
  EXPECT_DOUBLE_EQ(row_step({25, 25, 50}, 50), 0.5);
  EXPECT_DOUBLE_EQ(row_step({0, 0, 50}, 50), 1.0);
}

TEST(AnimateRates, AStatedRateComesFirst) {
  const Rates stated = rates_of("none/walk.motion", {50, 60, 25.0}),
              trained = rates_of("none/walk.motion", {0, 60, 25.0}),
              unknown = rates_of("none/walk.motion", {0, 60, {}}), foreign = rates_of("none/walk.bvh", {0, 0, 25.0});
  EXPECT_EQ(stated.source, 50);
  EXPECT_EQ(stated.result, 60);
  EXPECT_EQ(trained.source, 25);
  EXPECT_EQ(unknown.source, 0);
  EXPECT_EQ(foreign.source, 0);
  EXPECT_EQ(foreign.result, 25);
}

TEST(AnimateRates, ALoopHasWholeFramesOfTheResult) {
  for (int stride = 1; stride <= 12; ++stride)
    for (int frames = std::max(3, 3 * stride); frames < 400; ++frames) {
      const int blend = blended_frames(frames, 120.0, stride), kept = frames - blend;
      ASSERT_EQ(kept % stride, 0) << frames << " " << stride;
      ASSERT_GE(blend, 1) << frames << " " << stride;
      ASSERT_GT(kept, blend) << frames << " " << stride;
    }
  EXPECT_EQ(blended_frames(100, 25.0, 1), 13);
  EXPECT_EQ(blended_frames(40, 25.0, 1), 10);
  EXPECT_EQ(blended_frames(241, 120.0, 2), 61);
}

}  // namespace
}  // namespace doppel::animate_rates_test
