#include "doppel/detect/keypoints/limbs.h"

#include <gtest/gtest.h>

namespace doppel::limbs_test {
namespace {

TEST(Limbs, SticksNeedBothEnds) {
  EXPECT_EQ(sticks_between({"LElbow", "RElbow", "left_wrist", "Left Shoulder"}),
            (std::vector<std::array<int, 2>>{{3, 0}, {0, 2}}));
  EXPECT_EQ(sticks_between({"left_thumb2", "left_hand_root", "right_thumb1", "left_thumb1"}),
            (std::vector<std::array<int, 2>>{{1, 3}, {3, 0}}));
  EXPECT_TRUE(sticks_between({}).empty());
  EXPECT_EQ(sticks_between({"face_mesh_6", "face_mesh_338", "face_mesh_10", "face_mesh_168", "face-10"}),
            (std::vector<std::array<int, 2>>{{2, 1}, {3, 0}}))
      << "outline and nose of the face mesh";
}

}  // namespace
}  // namespace doppel::limbs_test
