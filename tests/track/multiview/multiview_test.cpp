#include "doppel/track/multiview/multiview.h"

#include <gmock/gmock.h>

#include <random>

#include "doppel/character/observable_dofs.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::multiview_test {
namespace {

using support::message_of;

/// A tube that walks, bends and turns once about itself, seen by four cameras.
class Multiview : public ::testing::Test {
 protected:
  static constexpr int kJoints = 4;
  Multiview()
      : character_(make_test_character(kJoints, 8, 14)),
        landmarks_(tube_landmarks(kJoints)),
        dofs_(observable_dofs(character_.skeleton, landmarks_)),
        cameras_(ring_of_cameras(4, 256, middle_of(character_))),
        model_(character_, landmarks_, dofs_) {}

  std::vector<double> ground_truth(int frame) const {
    std::vector<double> dofs = character_.rest_dofs;
    for (const int dof : dofs_)
      if (!model_.moves_root(dof)) dofs[dof] += 0.15 * std::sin(0.3 * frame + 1.3 * static_cast<double>(dof));
    dofs[0] += 0.15 * std::sin(0.2 * frame);
    dofs[3] += 2.0 * M_PI / 3.0 * frame / 24.0;  // a turn in 24 frames; the DoF counts three times
    return dofs;
  }

  FrameEvidence seen(int frame, bool masks = false) const {
    FrameEvidence evidence = keypoints_of(model_, cameras_, ground_truth(frame));
    for (std::size_t c = 0; masks && c < cameras_.size(); ++c)
      evidence[c].outline = OutlineField(mask_of(model_, cameras_[c], ground_truth(frame)), 128);
    return evidence;
  }

  /// Root mean square distance of the landmarks from the ground truth, metres.
  double error(const TrackedFrame& found, int frame) const {
    const PosedBody a = model_.pose(found.dofs, false), b = model_.pose(ground_truth(frame), false);
    double sum = 0.0;
    for (int m = 0; m < model_.num_landmarks(); ++m)
      sum += (model_.landmark(a, m) - model_.landmark(b, m)).squaredNorm();
    return std::sqrt(sum / model_.num_landmarks());
  }

  MultiviewTracker tracker(const MultiviewOptions& options = {}) const {
    return {character_, landmarks_, dofs_, cameras_, options};
  }

  Character character_;
  std::vector<Marker> landmarks_;
  std::vector<int> dofs_;
  std::vector<PinholeCamera> cameras_;
  PoseModel model_;
};

TEST_F(Multiview, RecoversAFullTurnFromNoStart) {
  MultiviewTracker tracked = tracker();
  for (int frame = 0; frame < 26; ++frame) {
    const TrackedFrame found = tracked.track(seen(frame, true));
    EXPECT_EQ(found.state, frame == 0 ? FrameState::initialised : FrameState::tracked) << "frame " << frame;
    EXPECT_LT(error(found, frame), 0.003) << "frame " << frame;
    EXPECT_EQ(found.inlier_ratio, 1.0);
  }
}

TEST_F(Multiview, SurvivesMissingPointsAndGrossOutliers) {
  std::mt19937 generator(3);
  const auto chance = [&] { return static_cast<double>(generator()) / 4294967296.0; };
  MultiviewTracker tracked = tracker();
  for (int frame = 0; frame < 20; ++frame) {
    FrameEvidence evidence = seen(frame);
    for (ViewEvidence& view : evidence)
      for (Keypoint& point : view.keypoints) {
        const double draw = chance();
        if (draw < 0.3) point = {};
        if (draw > 0.95) point = {static_cast<float>(256 * chance()), static_cast<float>(256 * chance()), 0.8f};
      }
    const TrackedFrame found = tracked.track(evidence);
    EXPECT_TRUE(found.found());
    EXPECT_LT(error(found, frame), 0.02) << "frame " << frame;
  }
}

TEST_F(Multiview, MarksFramesOfNobodyAndComesBack) {
  MultiviewTracker tracked = tracker();
  for (int frame = 0; frame < 12; ++frame) {
    FrameEvidence evidence = seen(frame);
    const bool nobody = frame >= 4 && frame < 8;
    if (nobody)
      for (ViewEvidence& view : evidence)
        for (Keypoint& point : view.keypoints) point.confidence = 0.3f;
    const TrackedFrame found = tracked.track(evidence);
    const FrameState expected = frame == 0   ? FrameState::initialised
                                : nobody     ? FrameState::lost
                                : frame == 8 ? FrameState::recovered
                                             : FrameState::tracked;
    EXPECT_EQ(to_string(found.state), to_string(expected)) << "frame " << frame;
    for (const double value : found.dofs) EXPECT_TRUE(std::isfinite(value));
    if (!nobody) {
      EXPECT_LT(error(found, frame), 0.005) << "frame " << frame;
    }
  }
}

TEST_F(Multiview, StartsAnewAtACutAndWhenTheBodyJumps) {
  MultiviewTracker tracked = tracker();
  tracked.track(seen(0));
  tracked.track(seen(1));
  EXPECT_EQ(tracked.track(seen(13)).state, FrameState::recovered) << "half a turn at once";
  tracked.cut();
  const TrackedFrame found = tracked.track(seen(2));
  EXPECT_EQ(found.state, FrameState::initialised);
  EXPECT_LT(error(found, 2), 0.003);
}

TEST_F(Multiview, MasksSeeWhatLandmarksDoNot) {
  // The last segment has lost its landmarks; where its tip is, only the outlines tell.
  const std::vector<Marker> few(landmarks_.begin(), landmarks_.end() - 2);
  const auto tip_distance = [&](double weight) {
    MultiviewOptions options;
    options.silhouette_weight = weight;
    MultiviewTracker tracked(character_, few, dofs_, cameras_, options);
    const int tip = character_.num_vertices() - 1;
    double sum = 0.0;
    for (int frame = 0; frame < 6; ++frame) {
      FrameEvidence evidence = seen(frame, true);
      for (ViewEvidence& view : evidence) view.keypoints.resize(few.size());
      const PosedBody found = model_.pose(tracked.track(evidence).dofs, false);
      const PosedBody expected = model_.pose(ground_truth(frame), false);
      sum += (model_.vertex(found, tip) - model_.vertex(expected, tip)).norm();
    }
    return sum / 6.0;
  };
  EXPECT_LT(tip_distance(50.0), 0.5 * tip_distance(0.0));
}

TEST_F(Multiview, SaysWhatItNeeds) {
  EXPECT_THAT(message_of<UsageError>([&] { MultiviewTracker(character_, landmarks_, dofs_, {cameras_[0]}); }),
              ::testing::HasSubstr("at least 2 cameras, received 1"));
  EXPECT_THAT(message_of<Error>([&] {
                MultiviewTracker(character_, {landmarks_.begin(), landmarks_.begin() + 2}, dofs_, cameras_);
              }),
              ::testing::HasSubstr("at least 4 landmarks"));
  MultiviewOptions options;
  options.limit_weight = -1.0;
  EXPECT_THAT(message_of<Error>([&] { tracker(options); }), ::testing::HasSubstr("limit weight of the fit is -1"));
}

TEST_F(Multiview, TriangulatesAgainstAMinorityOfOutliers) {
  FrameEvidence evidence = seen(5);
  evidence[2].keypoints[1].x += 60.0f;
  const auto found = triangulate(cameras_, evidence, 1);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->views, 3);
  EXPECT_LT((found->position - model_.landmark(model_.pose(ground_truth(5), false), 1)).norm(), 1e-4);
  for (std::size_t c = 1; c < 4; ++c) evidence[c].keypoints[1].confidence = 0.1f;
  EXPECT_FALSE(triangulate(cameras_, evidence, 1)) << "one ray is not enough";
}

}  // namespace
}  // namespace doppel::multiview_test
