#include "doppel/detect/keypoints/limbs.h"

#include <gtest/gtest.h>

namespace doppel::limbs_test {
namespace {

TEST(Limbs, SticksNeedBothEnds) {
  EXPECT_EQ(sticks_between({"LElbow", "RElbow", "left_wrist", "Left Shoulder"}),
            (std::vector<std::array<int, 2>>{{3, 0}, {0, 2}}));
  EXPECT_TRUE(sticks_between({}).empty());
}

}  // namespace
}  // namespace doppel::limbs_test
