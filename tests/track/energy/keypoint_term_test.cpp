#include "doppel/track/energy/terms/keypoint_term.h"

#include <gtest/gtest.h>

#include <numeric>

#include "doppel/detect/hands/hand_pose.h"
#include "doppel/track/energy/inliers.h"
#include "doppel/track/energy/landmark_weight.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::keypoint_term_test {
namespace {

class KeypointTermTest : public ::testing::Test {
 protected:
  KeypointTermTest()
      : character_(make_test_character(4)),
        model_(character_, tube_landmarks(4), all_dofs(character_)),
        cameras_(ring_of_cameras(3, 256, middle_of(character_))),
        frame_(keypoints_of(model_, cameras_, character_.rest_dofs)) {}

  Residuals rows_at(const std::vector<double>& dofs) const {
    Residuals rows;
    KeypointTerm<PoseModel>(cameras_, frame_, 2.0, kernel_).evaluate(model_, model_.pose(dofs, true), true, rows);
    return rows;
  }

  Character character_;
  PoseModel model_;
  std::vector<PinholeCamera> cameras_;
  FrameEvidence frame_;
  RobustKernel kernel_{RobustKernel::Kind::geman_mcclure, 30.0};
};

TEST_F(KeypointTermTest, CountsPixelsOfAImage1024Wide) {
  frame_[1].keypoints[2].x += 3.0f;
  frame_[1].keypoints[2].y -= 1.0f;
  const Residuals rows = rows_at(character_.rest_dofs);
  ASSERT_EQ(rows.num_rows(), 2 * 3 * model_.num_landmarks());
  const Eigen::Index first = 2 * (model_.num_landmarks() + 2);
  EXPECT_NEAR(rows.value(first), -3.0 * 1024 / 256, 1e-3);
  EXPECT_NEAR(rows.value(first + 1), 1.0 * 1024 / 256, 1e-3);
  EXPECT_NEAR(rows.value(0), 0.0, 1e-3);
  EXPECT_NEAR(rows.weight(0), 2.0 * 0.9, 1e-6);
}

TEST_F(KeypointTermTest, LeavesOutWhatTheDetectorDoubts) {
  frame_[0].keypoints[0].confidence = 0.39f;
  frame_[0].keypoints[1].confidence = 0.0f;
  frame_[0].keypoints[3].confidence = 0.4f;
  EXPECT_EQ(rows_at(character_.rest_dofs).num_rows(), 2 * (3 * model_.num_landmarks() - 2));
}

TEST_F(KeypointTermTest, CountsAllDetectionsAlikeAsTheThesisDoes) {
  frame_[0].keypoints[0].confidence = 0.05f;
  frame_[0].keypoints[1].confidence = 0.0f;
  frame_[0].keypoints[2].x += 2.0f;
  const PosedBody body = model_.pose(character_.rest_dofs, true);
  const std::vector<double> lambda(model_.num_landmarks(), 0.326);
  const auto rows_with = [&](const KeypointConfidence& confidence) {
    Residuals rows;
    KeypointTerm<PoseModel>(cameras_, frame_, 460.0, {}, lambda, confidence).evaluate(model_, body, true, rows);
    return rows;
  };
  const Residuals all = rows_with({false, 0.0});
  ASSERT_EQ(all.num_rows(), 2 * (3 * model_.num_landmarks() - 1)) << "only what was not detected is missing";
  for (Eigen::Index group = 0; group < all.num_rows() / 2; ++group)
    EXPECT_NEAR(all.weight(group), 460.0 * 0.326, 1e-9) << group;
  EXPECT_NEAR(all.value(2), 4.0 * -2.0, 1e-3) << "the third keypoint is in the second group";
  const Residuals sure = rows_with({false, 0.1});
  EXPECT_EQ(sure.num_rows(), all.num_rows() - 2);
  const Residuals weighed = rows_with({true, 0.0});
  EXPECT_NEAR(weighed.weight(0), 460.0 * 0.326 * 0.05, 1e-6);
  EXPECT_NEAR(weighed.weight(1), 460.0 * 0.326 * 0.9, 1e-4);
}

TEST_F(KeypointTermTest, AHandCountsAsThreePoints) {
  std::vector<std::string> left, right;
  for (const char* name : kHandPointNames) {
    left.push_back(std::string("left_") + name);
    right.push_back(std::string("right_") + name);
  }
  const std::vector<double> hand = landmark_fit_weights(left);
  EXPECT_EQ(hand, landmark_fit_weights(right));
  EXPECT_NEAR(std::accumulate(hand.begin(), hand.end(), 0.0), 3.0, 1e-12);
  EXPECT_EQ(landmark_fit_weights({"left_wrist", "left_index", "left_thumb", "thumb1", "nose", "left_big_toe"}),
            std::vector<double>(6, 1.0));
}

TEST_F(KeypointTermTest, AFaceCountsAsThreePoints) {
  EXPECT_EQ(landmark_fit_weights({"face_mesh_4", "nose", "face_mesh_33", "face-4", "face_mesh_263", "face_mesh_10"}),
            (std::vector<double>{0.75, 1.0, 0.75, 1.0, 0.75, 0.75}));
}

TEST_F(KeypointTermTest, PointsOfAHandReplaceThoseOfTheBody) {
  const std::vector<double> weights = landmark_fit_weights(
      {"left_wrist", "left_thumb", "left_index", "left_pinky", "right_index", "left_hand_root", "left_thumb1"});
  EXPECT_EQ(weights, (std::vector<double>{1.0, 0.0, 0.0, 0.0, 1.0, 1.0 / 7.0, 1.0 / 7.0}))
      << "the right hand has no points of its own";
}

TEST_F(KeypointTermTest, WeighsThePointsOfHandsLess) {
  std::vector<Marker> landmarks = model_.landmarks();
  landmarks[1].name = "right_ring_finger3";
  const PoseModel with_finger(character_, landmarks, all_dofs(character_));
  Residuals rows;
  KeypointTerm<PoseModel>(cameras_, frame_, 2.0, kernel_)
      .evaluate(with_finger, with_finger.pose(character_.rest_dofs, true), true, rows);
  EXPECT_NEAR(rows.weight(1), 2.0 * 0.9 / 7.0, 1e-6);
  EXPECT_NEAR(rows.weight(0), 2.0 * 0.9, 1e-6);
}

TEST_F(KeypointTermTest, InliersCountTheSameWay) {
  std::vector<Marker> landmarks = model_.landmarks();
  landmarks[1].name = "right_ring_finger3";
  const PoseModel with_finger(character_, landmarks, all_dofs(character_));
  frame_[0].keypoints[1].x += 1000.0f;
  const int m = model_.num_landmarks();
  const Inliers inliers =
      count_inliers(with_finger, with_finger.pose(character_.rest_dofs, false), cameras_, frame_, 40.0);
  EXPECT_EQ(inliers.keypoints, 3 * m);
  EXPECT_NEAR(inliers.ratio, 1.0 - (1.0 / 7.0) / (3 * (m - 1) + 3.0 / 7.0), 1e-12);
}

TEST_F(KeypointTermTest, JacobianAreCentralDifferences) {
  KeypointTerm<PoseModel> term(cameras_, frame_, 2.0, kernel_);
  support::check_term(term, model_, bent_pose(character_, 0.15), 1e-5);
  support::check_energy_gradient(term, model_, bent_pose(character_, 0.15));
  support::check_weight([&](double weight) { return KeypointTerm<PoseModel>(cameras_, frame_, weight, kernel_); },
                        model_, bent_pose(character_, 0.15));
}

TEST_F(KeypointTermTest, JacobianThereWhereTheResidualIsZero) {
  Residuals rows = rows_at(character_.rest_dofs);
  EXPECT_LT(std::abs(rows.value(0)), 1e-3);
  EXPECT_GT(rows.jacobian(0).norm(), 10.0);
}

TEST_F(KeypointTermTest, ALandmarkBehindACameraIsFarFromWhereItWasSeen) {
  std::vector<double> dofs = character_.rest_dofs;
  const Eigen::Vector3d beyond = 2.0 * (cameras_[0].centre() - middle_of(character_));
  for (int i = 0; i < 3; ++i) dofs[i] += beyond[i];
  const Residuals rows = rows_at(dofs);
  ASSERT_EQ(rows.num_rows(), 2 * 3 * model_.num_landmarks());
  EXPECT_EQ(rows.value(0), kBehindCamera);
  EXPECT_EQ(rows.value(1), 0.0);
}

}  // namespace
}  // namespace doppel::keypoint_term_test
