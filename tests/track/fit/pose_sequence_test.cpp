#include "doppel/track/fit/pose_sequence.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"

namespace doppel::pose_sequence_test {
namespace {

class PoseSequence : public ::testing::Test {
 protected:
  PoseSequence() : character_(make_test_character(3)), root_(RootRotation::of(character_.skeleton)) {
    for (int f = 0; f < 12; ++f) {
      poses_.push_back(character_.rest_dofs);
      poses_.back()[0] = 0.1 * f;
      poses_.back()[7] = f % 2 ? 1.0 : -1.0;
      poses_.back()[3] = 0.2 * f;
    }
  }
  Character character_;
  std::optional<RootRotation> root_;
  std::vector<std::vector<double>> poses_;
};

TEST_F(PoseSequence, BridgesGapsWithinASegmentOnly) {
  const auto before = poses_;
  std::vector<bool> found(12, true);
  for (const int f : {0, 3, 4, 8, 9, 10, 11}) found[f] = false;
  bridge_poses(poses_, found, {7}, root_);
  EXPECT_EQ(poses_[0], before[1]);
  EXPECT_NEAR(poses_[3][0], 0.3, 1e-12);
  EXPECT_NEAR(poses_[3][7], before[2][7] + (before[5][7] - before[2][7]) / 3.0, 1e-12);
  EXPECT_LT((root_->matrix(poses_[3]) - root_->matrix(before[3])).norm(), 1e-9);
  EXPECT_EQ(poses_[8], before[7]) << "at the end of a segment the nearest found frame is held";
  EXPECT_EQ(poses_[6], before[6]);
}

TEST_F(PoseSequence, ASegmentThatWasNeverFoundTakesTheNearestPose) {
  const auto before = poses_;
  std::vector<bool> found(12, true);
  for (std::size_t f = 7; f < 12; ++f) found[f] = false;
  bridge_poses(poses_, found, {7}, root_);
  EXPECT_EQ(poses_[11], before[6]);
  bridge_poses(poses_, std::vector<bool>(12, false), {7}, root_);
  EXPECT_EQ(poses_[11], before[6]);
}

TEST_F(PoseSequence, SmoothsWithinSegmentsAndTurnsTheRootAsARotation) {
  const auto before = poses_;
  // The same rotations, written with angles a whole turn apart.
  for (std::size_t f = 6; f < 12; ++f) poses_[f][3] -= 2.0 * M_PI / 3.0;
  smooth_poses(poses_, {}, root_, 1.0);
  EXPECT_LT(std::abs(poses_[5][7]), 0.3);
  for (std::size_t f = 2; f < 10; ++f)
    EXPECT_LT((root_->matrix(poses_[f]) - root_->matrix(before[f])).norm(), 0.02) << "frame " << f;
  for (std::size_t f = 1; f < 12; ++f) EXPECT_LT(std::abs(poses_[f][3] - poses_[f - 1][3]), 0.3);

  poses_ = before;
  for (std::size_t f = 6; f < 12; ++f) poses_[f][0] += 100.0;
  smooth_poses(poses_, {6}, root_, 1.0);
  EXPECT_LT(poses_[5][0], 1.0);
  EXPECT_GT(poses_[6][0], 100.0);
}

TEST_F(PoseSequence, ParabolasKeepThePeaksOfQuickMovements) {
  const auto swing = [](std::size_t f) { return std::cos(2.0 * M_PI * static_cast<double>(f) / 8.0); };
  for (std::size_t f = 0; f < 12; ++f) {
    poses_[f][0] = 0.3 * static_cast<double>(f * f) - 2.0 * static_cast<double>(f);
    poses_[f][8] = swing(f);
    poses_[f][3] = 0.05 * static_cast<double>(f);
  }
  const auto before = poses_;
  auto mean = poses_;
  smooth_poses(mean, {}, root_, 1.0);
  smooth_poses(poses_, {}, root_, 1.5, 2);
  double lost = 0.0, kept = 0.0;
  for (std::size_t f = 0; f < 12; ++f) {
    EXPECT_NEAR(poses_[f][0], before[f][0], 1e-9) << "a parabola stays as it is, at the ends too";
    EXPECT_LT((root_->matrix(poses_[f]) - root_->matrix(before[f])).norm(), 0.01) << "frame " << f;
    lost = std::max(lost, std::abs(mean[f][8] - swing(f)));
    kept = std::max(kept, std::abs(poses_[f][8] - swing(f)));
  }
  EXPECT_LT(kept, 0.5 * lost);
  EXPECT_LT(std::abs(poses_[5][7]), 0.3) << "a flicker from frame to frame goes all the same";
}

TEST_F(PoseSequence, ShortSegmentsAreSmoothedAsFarAsTheyReach) {
  const auto before = poses_;
  smooth_poses(poses_, {1, 3}, root_, 2.0, 2);
  EXPECT_NEAR(poses_[0][7], before[0][7], 1e-12) << "a single frame";
  EXPECT_NEAR(poses_[1][7], before[1][7], 1e-9) << "two frames are on a line";
  for (const auto& pose : poses_)
    for (const double value : pose) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace doppel::pose_sequence_test
