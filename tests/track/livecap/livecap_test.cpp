#include "doppel/track/livecap/livecap.h"

#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/character/observable_dofs.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::livecap_test {
namespace {

using Eigen::Vector3d;

constexpr int kWindow = 512;  // pixels of the windows that both outlines are looked for in

/// Exactly the pixels whose centres a posed surface covers.
cv::Mat coverage_of(const PosedSurface& surface, const Character& character, const PinholeCamera& camera) {
  torch::Tensor vertices = torch::empty({1, surface.vertices.cols(), 3});
  Eigen::Map<Eigen::Matrix3Xf>(vertices.data_ptr<float>(), 3, surface.vertices.cols()) = surface.vertices.cast<float>();
  Rasterizer rasterizer(RenderMesh(character.mesh).faces);
  torch::Tensor covered = rasterizer.coverage_projected(
      vertices, projection_tensor({PinholeCamera(camera)}).unsqueeze(0), camera.height, camera.width);
  return cv::Mat(camera.height, camera.width, CV_8UC1, covered.data_ptr()) * 255;
}

/// The test character, moving, before one camera.
struct Scene {
  Character character = make_test_character(5, 16, 40);
  std::vector<Marker> landmarks = tube_landmarks(5);
  std::vector<int> dofs = observable_dofs(character.skeleton, landmarks);
  PoseModel model{character, landmarks, dofs};
  PinholeCamera camera = ring_of_cameras(1, 600, middle_of(character)).front();
  RootRotation root = *model.root();

  /// Everything sways, and the body turns about the vertical. @param turn radians a frame
  std::vector<double> ground_truth(int frame, double turn = 0.05) const {
    std::vector<double> pose = character.rest_dofs;
    for (const int dof : dofs)
      if (!model.moves_root(dof)) pose[dof] += 0.1 * std::sin(0.15 * frame + 1.9 * dof);
    root.set_matrix(pose, rotation_of_vector({0.0, turn * frame, 0.0}) * root.matrix(character.rest_dofs));
    root.set_position(pose, root.position(character.rest_dofs) + Vector3d(0.01 * frame, 0.0, 0.005 * frame));
    return pose;
  }
  PosedSurface surface(const std::vector<double>& pose) const {
    return pose_surface(model, model.pose(pose, false), character.mesh.vertices);
  }
  /// Exact evidence of a pose.
  LivecapInput see(const std::vector<double>& pose) const {
    LivecapInput input;
    input.view = keypoints_of(model, {camera}, pose).front();
    input.view.outline = OutlineField(coverage_of(surface(pose), character, camera), kWindow);
    const PosedBody body = model.pose(pose, false);
    const Vector3d origin = model.landmark(body, 0);
    for (int m = 0; m < model.num_landmarks(); ++m)
      input.joints.push_back({camera.R * (model.landmark(body, m) - origin), true});
    return input;
  }
  double joint_error(const std::vector<double>& a, const std::vector<double>& b) const {
    const PosedBody in_a = model.pose(a, false), in_b = model.pose(b, false);
    double largest = 0.0;
    for (int m = 0; m < model.num_landmarks(); ++m)
      largest = std::max(largest, (model.landmark(in_a, m) - model.landmark(in_b, m)).norm());
    return largest;
  }
  double surface_error(const Eigen::Matrix3Xd& vertices, const std::vector<double>& pose) const {
    return (vertices - surface(pose).vertices).colwise().norm().mean();
  }
  LivecapTracker tracker(LivecapOptions options = {}) const {
    options.outline_pixels = options.nonrigid.window_pixels = kWindow;
    return LivecapTracker(character, landmarks, dofs, camera, options);
  }
};

TEST(Livecap, FindsAPoseFromNothingAndFollowsIt) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  for (int frame = 0; frame < 8; ++frame) {
    const std::vector<double> ground_truth = scene.ground_truth(frame);
    const FrameResult found = tracker.track(scene.see(ground_truth));
    EXPECT_EQ(found.pose.state, frame == 0 ? FrameState::initialised : FrameState::tracked);
    EXPECT_LT(scene.joint_error(found.pose.dofs, ground_truth), frame == 0 ? 0.03 : 0.015) << "frame " << frame;
    EXPECT_LT(scene.surface_error(found.vertices, ground_truth), 0.015) << "frame " << frame;
    if (frame > 0) {
      EXPECT_LE(found.pose.iterations, 6);
    }
  }
}

TEST(Livecap, ConvergesToTheGroundTruthWithoutNoiseAndStaysThere) {
  const Scene scene;
  const std::vector<double> ground_truth = scene.ground_truth(3);
  LivecapTracker tracker = scene.tracker();
  tracker.track(scene.see(scene.ground_truth(2)));
  const LivecapInput seen = scene.see(ground_truth);
  for (int frame = 0; frame < 60; ++frame) {
    const FrameResult found = tracker.track(seen);
    if (frame < 4) continue;
    // The prior pulls to the rest pose.
    EXPECT_LT(scene.joint_error(found.pose.dofs, ground_truth), 0.004) << "frame " << frame;
    EXPECT_LT(scene.surface_error(found.vertices, ground_truth), 0.003) << "frame " << frame;
  }
}

TEST(Livecap, FollowsAFastTurn) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  constexpr int kFrames = 20;  // 360 degrees in 20 frames
  FrameResult found;
  for (int frame = 0; frame <= kFrames; ++frame)
    found = tracker.track(scene.see(scene.ground_truth(frame, 2 * M_PI / kFrames)));
  for (int frame = 0; frame < 10; ++frame)
    found = tracker.track(scene.see(scene.ground_truth(kFrames, 2 * M_PI / kFrames)));
  EXPECT_TRUE(found.pose.found());
  EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(kFrames, 2 * M_PI / kFrames)), 0.01);
}

/// What a poor detector sees: of ten points 30 % are missing and 5 % far off.
LivecapInput with_poor_detections(LivecapInput input, test_character::Noise& noise) {
  for (std::size_t m = 0; m < input.view.keypoints.size(); ++m) {
    const double chance = 0.5 + 0.5 * noise.next();
    if (chance < 0.3) {
      input.view.keypoints[m] = {};
      input.joints[m].seen = false;
    } else if (chance < 0.35) {
      input.view.keypoints[m].x += 150.0f;
    }
  }
  return input;
}

TEST(Livecap, StandsMissingPointsAndOutliers) {
  const Scene scene;
  LivecapOptions options;
  options.min_keypoints = 5;  // of ten
  int lost_frames = 0;
  for (const unsigned seed : {5u, 30u, 36u}) {
    LivecapTracker tracker = scene.tracker(options);
    test_character::Noise noise(seed);
    bool lost = false;
    for (int frame = 0; frame < 40; ++frame) {
      const LivecapInput exact = scene.see(scene.ground_truth(frame));
      const FrameResult found = tracker.track(frame == 0 ? exact : with_poor_detections(exact, noise));
      EXPECT_TRUE(found.vertices.allFinite());
      for (const double value : found.pose.dofs) EXPECT_TRUE(std::isfinite(value));
      if (found.pose.found()) {
        EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(frame)), 0.04)
            << "seed " << seed << " frame " << frame;
        EXPECT_EQ(found.pose.state == FrameState::recovered, lost) << "seed " << seed << " frame " << frame;
      }
      lost = !found.pose.found();
      lost_frames += lost;
    }
    const FrameResult found = tracker.track(scene.see(scene.ground_truth(40)));
    EXPECT_TRUE(found.pose.found());
    EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(40)), 0.03);
  }
  EXPECT_LE(lost_frames, 18) << "in one frame of twenty too few points are left";
}

TEST(Livecap, AnArmThatWasHiddenIsFoundAgain) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker([] {
    LivecapOptions options;
    options.min_keypoints = 5;
    return options;
  }());
  FrameResult found;
  for (int frame = 0; frame < 30; ++frame) {
    LivecapInput input = scene.see(scene.ground_truth(frame));
    for (std::size_t m = 6; m < 10 && frame >= 5 && frame < 20; ++m) {  // the last two segments
      input.view.keypoints[m] = {};
      input.joints[m].seen = false;
    }
    found = tracker.track(input);
    EXPECT_TRUE(found.pose.found()) << "frame " << frame;
  }
  EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(29)), 0.015) << "ten frames after it came back";
}

TEST(Livecap, AMaskOfSomethingElseDoesNotThrowItOff) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  cv::Mat wrong = cv::Mat::zeros(scene.camera.height, scene.camera.width, CV_8UC1);
  wrong(cv::Rect(10, 20, 200, 500)).setTo(255);
  FrameResult found;
  for (int frame = 0; frame < 24; ++frame) {
    LivecapInput input = scene.see(scene.ground_truth(frame));
    if (frame >= 4 && frame < 12) input.view.outline = OutlineField(frame % 2 ? wrong : cv::Mat(~wrong), kWindow);
    found = tracker.track(input);
    EXPECT_TRUE(found.vertices.allFinite()) << "frame " << frame;
    for (const double value : found.pose.dofs) EXPECT_TRUE(std::isfinite(value));
  }
  EXPECT_TRUE(found.pose.found());
  EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(23)), 0.015);
  EXPECT_LT(scene.surface_error(found.vertices, scene.ground_truth(23)), 0.015);
}

TEST(Livecap, AfterAPauseThePersonIsRecovered) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  for (int frame = 0; frame < 3; ++frame) tracker.track(scene.see(scene.ground_truth(frame)));
  tracker.pause();
  const FrameResult found = tracker.track(scene.see(scene.ground_truth(40)));
  EXPECT_EQ(found.pose.state, FrameState::recovered);
  EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(40)), 0.03);
}

TEST(Livecap, LosesWhoeverLeavesAndFindsThemAgain) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  for (int frame = 0; frame < 4; ++frame) tracker.track(scene.see(scene.ground_truth(frame)));
  LivecapInput nobody;
  nobody.view.keypoints.resize(scene.landmarks.size());
  nobody.image = cv::Mat::zeros(scene.camera.height, scene.camera.width, CV_8UC3);
  for (int frame = 0; frame < 20; ++frame) {
    const FrameResult found = tracker.track(nobody);
    EXPECT_EQ(found.pose.state, FrameState::lost);
    EXPECT_TRUE(found.vertices.allFinite());
    EXPECT_LT(scene.joint_error(found.pose.dofs, scene.ground_truth(3)), 0.02) << "the last pose that was found";
  }
  const FrameResult again = tracker.track(scene.see(scene.ground_truth(30)));
  EXPECT_EQ(again.pose.state, FrameState::recovered);
  EXPECT_LT(scene.joint_error(again.pose.dofs, scene.ground_truth(30)), 0.03);
  EXPECT_EQ(tracker.track(scene.see(scene.ground_truth(31))).pose.state, FrameState::tracked);
}

TEST(Livecap, WorksWithoutJointsInSpace) {
  const Scene scene;
  LivecapTracker tracker = scene.tracker();
  FrameResult found;
  for (int frame = 0; frame < 6; ++frame) {
    LivecapInput input = scene.see(scene.ground_truth(frame));
    input.joints.clear();
    found = tracker.track(input);
    EXPECT_TRUE(found.pose.found()) << "frame " << frame;
  }
  EXPECT_LT(found.pose.keypoint_error, 4.0);
  for (const TermCost& term : found.pose.terms) EXPECT_NE(term.name, "joints");
}

/// Joints of which every second one is 15 cm too far away.
TEST(Livecap, JointsCountByTheirNoise) {
  const Scene scene;
  const auto error_with = [&](double noise) {
    LivecapTracker tracker = scene.tracker();
    double error = 0.0;
    for (int frame = 0; frame < 8; ++frame) {
      LivecapInput input = scene.see(scene.ground_truth(frame));
      for (std::size_t m = 0; m < input.joints.size(); ++m) {
        input.joints[m].position.z() += m % 2 == 0 ? 0.15 : 0.0;
        input.joints[m].noise = noise;
      }
      error = scene.joint_error(tracker.track(input).pose.dofs, scene.ground_truth(frame));
    }
    return error;
  };
  EXPECT_LT(error_with(0.15), 0.5 * error_with(kJointNoise));
}

TEST(Livecap, WorksWithoutTheTermOfKeypoints) {
  const Scene scene;
  LivecapOptions options;
  options.keypoint_weight = 0.0;
  LivecapTracker tracker = scene.tracker(options);
  for (int frame = 0; frame < 6; ++frame) {
    const std::vector<double> ground_truth = scene.ground_truth(frame);
    const FrameResult found = tracker.track(scene.see(ground_truth));
    EXPECT_TRUE(found.pose.found()) << "frame " << frame;
    EXPECT_LT(scene.joint_error(found.pose.dofs, ground_truth), 0.04) << "frame " << frame;
    for (const TermCost& term : found.pose.terms) EXPECT_NE(term.name, "keypoints");
  }
}

TEST(Livecap, TermsOfWeightZeroAreOff) {
  const Scene scene;
  LivecapOptions options;
  options.joint_weight = options.silhouette_weight = options.temporal_weight = options.limit_weight = 0.0;
  options.prior_weight = options.steady_weight = options.motion.turn_weight = 0.0;
  options.surface = false;
  LivecapTracker tracker = scene.tracker(options);
  tracker.track(scene.see(scene.ground_truth(0)));
  const FrameResult found = tracker.track(scene.see(scene.ground_truth(1)));
  ASSERT_EQ(found.pose.terms.size(), 1u);
  EXPECT_EQ(found.pose.terms[0].name, "keypoints");
}

/// The silhouette term is that of 4.5 without own distances: the sum of [I_DT(pi(V_i))]^2 over the outline vertices.
TEST(Livecap, TheSilhouetteCountsOwnDistancesOrNot) {
  const Scene scene;
  const LivecapInput seen = scene.see(scene.ground_truth(0));
  for (const bool own_distance : {true, false}) {
    LivecapOptions options;
    options.own_distance = own_distance;
    options.level_silhouette = options.surface = false;
    options.silhouette_scale = options.keypoint_scale = 0.0;
    options.silhouette_weight = 1e-9;  // the other terms decide the pose
    options.outline_vertices = 100000;
    options.prior_weight = options.limit_weight = options.floor_weight = options.motion.turn_weight = 0.0;
    LivecapTracker tracker = scene.tracker(options);
    FrameResult found;
    for (int frame = 0; frame < 4; ++frame) found = tracker.track(seen);
    const PosedSurface surface = scene.surface(found.pose.dofs);
    SurfaceViewer viewer(scene.character, scene.camera, kWindow);
    double expected = 0.0, other = 0.0;
    for (const OutlineVertex& vertex : viewer.look(surface, seen.view.outline.box(), 0.0).outline) {
      const Eigen::Vector2d pixel = scene.camera.project(surface.vertices.col(vertex.vertex));
      const double distance = reference_pixels(scene.camera) * seen.view.outline.at(pixel).distance;
      const double relative = std::pow(distance - vertex.distance, 2), alone = std::pow(distance, 2);
      expected += own_distance ? relative : alone;
      other += own_distance ? alone : relative;
    }
    ASSERT_GT(std::abs(expected - other), 0.5 * expected) << "the two can be told apart";
    double cost = -1.0;
    for (const TermCost& term : found.pose.terms)
      if (term.name == "silhouette") cost = term.cost;
    EXPECT_NEAR(cost / options.silhouette_weight, expected, 0.1 * expected) << own_distance;
  }
}

TEST(Livecap, SaysWhatItNeeds) {
  const Scene scene;
  LivecapOptions options;
  options.keypoint_weight = 0.0;
  EXPECT_NO_THROW(scene.tracker(options)) << "joints in space are left";
  options.joint_weight = 0.0;
  EXPECT_NE(support::message_of([&] { scene.tracker(options); }).find("without either"), std::string::npos);
  EXPECT_NE(support::message_of([&] {
              LivecapTracker(scene.character, {scene.landmarks[0]}, scene.dofs, scene.camera);
            }).find("at least 4 landmarks"),
            std::string::npos);
}

}  // namespace
}  // namespace doppel::livecap_test
