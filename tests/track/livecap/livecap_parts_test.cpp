#include <gtest/gtest.h>

#include "doppel/core/as_size.h"
#include "doppel/track/energy/alignment.h"
#include "doppel/track/fit/pose_history.h"
#include "doppel/track/livecap/bone_lengths.h"
#include "doppel/track/livecap/landmark_roles.h"
#include "doppel/track/livecap/single_view_start.h"
#include "track/energy/body_fixture.h"

namespace doppel::livecap_parts_test {
namespace {

using Eigen::Vector3d;

TEST(LandmarkRoles, AreToldByNames) {
  std::vector<Marker> landmarks(7);
  const char* names[] = {"Nose", "left_ear", "RShoulder", "LKnee", "r_wrist", "MidHip", "forearm"};
  for (std::size_t m = 0; m < landmarks.size(); ++m) landmarks[m].name = names[m];
  const LandmarkRoles roles = landmark_roles(landmarks);
  EXPECT_EQ(roles.detection, (std::vector<double>{0.326, 0.326, 1, 1, 1, 1, 1}));
  EXPECT_EQ(roles.steadiness, (std::vector<double>{2.5, 2.5, 2.0, 1.5, 1.0, 2.5, 1.0}));
}

TEST(LandmarkRoles, WarnOfUnknownNames) {
  std::vector<Marker> landmarks(2);
  landmarks[0].name = "left_knee";
  landmarks[1].name = "marker_17";
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  landmark_roles(landmarks);
  const std::string warning = ::testing::internal::GetCapturedStderr() + ::testing::internal::GetCapturedStdout();
  EXPECT_NE(warning.find("without a role: marker_17."), std::string::npos) << warning;
}

struct Body {
  Character character = make_test_character();
  PoseModel model{character, tube_landmarks(5), all_dofs(character)};
  LandmarkTree tree{character.skeleton, model.landmarks(), character.rest_dofs};
  std::vector<double> dofs = bent_pose(character, 0.2);
  std::vector<Vector3d> points(const std::vector<double>& pose) const {
    std::vector<Vector3d> result;
    const PosedBody body = model.pose(pose, false);
    for (int m = 0; m < model.num_landmarks(); ++m) result.push_back(model.landmark(body, m));
    return result;
  }
  std::vector<std::optional<Vector3d>> scaled(const std::vector<Vector3d>& points, double scale) const {
    std::vector<std::optional<Vector3d>> result;
    for (const Vector3d& point : points) result.emplace_back(scale * point);
    return result;
  }
};

TEST(LandmarkTree, HangsOnTheNextLandmarkTowardsTheRoot) {
  const Body body;
  EXPECT_EQ(body.tree.parent(body.tree.root()), -1);
  EXPECT_LT(body.tree.root(), 2) << "on the first segment";
  EXPECT_EQ(body.tree.parent(4), 2);
  EXPECT_EQ(body.tree.parent(5), 2);
  EXPECT_EQ(body.tree.parent(8), 6);
}

TEST(LandmarkTree, GivesANormalisedBodyItsSizeBack) {
  const Body body;
  const std::vector<Vector3d> points = body.points(body.dofs);
  const auto root = as_size(body.tree.root());
  const auto found = body.tree.with_lengths_of(body.scaled(points, 0.37), points);
  for (std::size_t m = 0; m < points.size(); ++m)
    EXPECT_LT((*found[m] - *found[root] - (points[m] - points[root])).norm(), 1e-9) << "landmark " << m;
}

TEST(LandmarkTree, BridgesMissingParentsAndKeepsLonelyPoints) {
  const Body body;
  const std::vector<Vector3d> points = body.points(body.dofs);
  auto joints = body.scaled(points, 2.0);
  joints[4].reset();
  const auto found = body.tree.with_lengths_of(joints, points);
  EXPECT_FALSE(found[4]);
  EXPECT_NEAR((*found[6] - *found[2]).norm(), (points[6] - points[2]).norm(), 1e-9);
  std::vector<std::optional<Vector3d>> lonely(points.size());
  lonely[6] = Vector3d(1.0, 2.0, 3.0);
  EXPECT_EQ(body.tree.with_lengths_of(lonely, points)[6], Vector3d(1.0, 2.0, 3.0));
}

TEST(SingleViewStart, ShiftsOntoTheRays) {
  const Body body;
  const std::vector<PinholeCamera> cameras = ring_of_cameras(1, 500, middle_of(body.character));
  const std::vector<Keypoint> seen = keypoints_of(body.model, cameras, body.dofs).front().keypoints;
  const Vector3d away(0.3, -0.2, 0.5);
  std::vector<std::optional<Vector3d>> points;
  for (const Vector3d& point : body.points(body.dofs)) points.emplace_back(point - away);
  const auto shift = shift_onto_rays(cameras.front(), seen, points);
  ASSERT_TRUE(shift);
  EXPECT_LT((*shift - away).norm(), 1e-4) << "keypoints are floats";
  for (std::size_t m = 3; m < points.size(); ++m) points[m].reset();
  EXPECT_FALSE(shift_onto_rays(cameras.front(), seen, points)) << "three points are too few";
}

TEST(SingleViewStart, LaysTheRootOnJointsInSpace) {
  const Body body;
  const std::vector<PinholeCamera> cameras = ring_of_cameras(1, 500, middle_of(body.character));
  std::vector<double> ground_truth = body.character.rest_dofs;
  const RootRotation& root = *body.model.root();
  root.set_matrix(ground_truth, rotation_of_vector({0.2, 2.0, -0.1}) * root.matrix(ground_truth));
  const std::vector<Keypoint> seen = keypoints_of(body.model, cameras, ground_truth).front().keypoints;
  const auto joints = body.scaled(body.points(ground_truth), 1.0);
  const std::vector<double> rigidity = rigidity_of_landmarks(body.model);
  const auto starts = single_view_starts(body.model, cameras.front(), seen, joints, rigidity, body.character.rest_dofs);
  ASSERT_EQ(starts.size(), 1u);
  EXPECT_LT((root.matrix(starts[0]) - root.matrix(ground_truth)).norm(), 1e-3);
  EXPECT_LT((root.position(starts[0]) - root.position(ground_truth)).norm(), 1e-3);
  const std::vector<std::optional<Vector3d>> none(joints.size());
  EXPECT_EQ(single_view_starts(body.model, cameras.front(), seen, none, rigidity, body.character.rest_dofs).size(), 4u);
  EXPECT_TRUE(single_view_starts(body.model, cameras.front(), std::vector<Keypoint>(seen.size()), none, rigidity,
                                 body.character.rest_dofs)
                  .empty());
}

TEST(PoseHistory, LeadsOnAtTheSameSpeed) {
  PoseHistory history({1.0, 2.0});
  EXPECT_TRUE(history.empty());
  EXPECT_EQ(history.last(), (std::vector<double>{1.0, 2.0}));
  const auto frame = [](const std::vector<double>& dofs, FrameState state) {
    TrackedFrame result;
    result.dofs = dofs;
    result.state = state;
    return result;
  };
  EXPECT_EQ(history.state_of_restart(), FrameState::initialised);
  history.remember(frame({2.0, 2.0}, FrameState::initialised));
  EXPECT_EQ(history.predicted(std::nullopt), (std::vector<double>{2.0, 2.0}));
  history.remember(frame({2.5, 1.0}, FrameState::tracked));
  EXPECT_EQ(history.predicted(std::nullopt), (std::vector<double>{3.0, 0.0}));
  EXPECT_EQ(history.state_of_restart(), FrameState::recovered);
  history.remember(frame({9.0, 9.0}, FrameState::recovered));
  EXPECT_EQ(history.predicted(std::nullopt), (std::vector<double>{9.0, 9.0}));
  history.remember(frame({5.0, 5.0}, FrameState::lost));
  EXPECT_TRUE(history.empty());
  EXPECT_EQ(history.last(), (std::vector<double>{9.0, 9.0}));
  history.cut();
  EXPECT_EQ(history.state_of_restart(), FrameState::initialised);
}

}  // namespace
}  // namespace doppel::livecap_parts_test
