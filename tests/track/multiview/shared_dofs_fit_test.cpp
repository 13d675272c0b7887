#include "doppel/track/multiview/shared_dofs_fit.h"

#include <gmock/gmock.h>

#include "doppel/character/dof_names.h"
#include "doppel/character/observable_dofs.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::usual_fit_test {
namespace {

using support::message_of;

/// A tube that sways while its last segment, on which there is no landmark, stays bent by 40 degrees and more: a hand
/// at a wrist, seen by four cameras.
class BentWrist : public ::testing::Test {
 protected:
  static constexpr int kJoints = 4, kFrames = 6;
  static constexpr double kBend = 40.0 * M_PI / 180.0, kSide = 0.3;

  BentWrist()
      : character_(make_test_character(kJoints, 12, 20)),
        landmarks_(tube_landmarks(kJoints - 1)),
        wrist_{dof("lean_3"), dof("flex_3")},
        cameras_(ring_of_cameras(4, 256, middle_of(character_))),
        model_(character_, landmarks_, observable_dofs(character_.skeleton, landmarks_)) {}

  int dof(const std::string& name) const { return find_dofs(character_.skeleton, name).at(0); }

  /// @param swing of the wrist about its usual bend, radians
  std::vector<double> ground_truth(int frame, double swing = 0.0) const {
    std::vector<double> dofs = character_.rest_dofs;
    for (const int d : observable_dofs(character_.skeleton, landmarks_))
      if (!model_.moves_root(d)) dofs[d] += 0.15 * std::sin(0.9 * frame + 1.3 * static_cast<double>(d));
    dofs[wrist_[0]] = kBend + swing * std::sin(0.7 * frame);
    dofs[wrist_[1]] = kSide;
    dofs[3] += 0.1 * frame;
    return dofs;
  }

  FrameEvidence seen(const std::vector<double>& dofs) const {
    FrameEvidence evidence = keypoints_of(model_, cameras_, dofs);
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      evidence[c].outline = OutlineField(mask_of(model_, cameras_[c], dofs), 128);
    return evidence;
  }

  std::vector<PosedEvidence> frames() const {
    std::vector<PosedEvidence> result;
    for (int frame = 0; frame < kFrames; ++frame) result.push_back({seen(ground_truth(frame)), ground_truth(frame)});
    return result;
  }

  std::vector<double> found(const std::vector<PosedEvidence>& frames) const {
    return fit_shared_dofs(character_, landmarks_, cameras_, wrist_, frames, MultiviewOptions());
  }

  /// Mean distance of the far end from the ground truth while the wrist swings, metres.
  double tip_error(const std::vector<int>& dofs, const SharedDofs& shared) const {
    MultiviewOptions options;
    options.shared_dofs = shared;
    MultiviewTracker tracker(character_, landmarks_, dofs, cameras_, options);
    const int tip = character_.num_vertices() - 1;
    double sum = 0.0;
    for (int frame = 0; frame < kFrames; ++frame) {
      const PosedBody is = model_.pose(tracker.track(seen(ground_truth(frame, 0.2))).dofs, false);
      sum += (model_.vertex(is, tip) - model_.vertex(model_.pose(ground_truth(frame, 0.2), false), tip)).norm();
    }
    return sum / kFrames;
  }

  Character character_;
  std::vector<Marker> landmarks_;
  std::vector<int> wrist_;
  std::vector<PinholeCamera> cameras_;
  PoseModel model_;
};

TEST_F(BentWrist, IsFoundFromTheOutlinesOfAllFrames) {
  std::vector<PosedEvidence> all = frames();
  for (PosedEvidence& frame : all)  // what the wrist was thought to be does not matter
    for (const int dof : wrist_) frame.dofs[dof] = -0.5;
  const std::vector<double> values = found(all);
  EXPECT_NEAR(values[0], kBend, 0.05);
  EXPECT_NEAR(values[1], kSide, 0.07) << "0.7 radians per unit";
}

TEST_F(BentWrist, IsHeldWhereItIsNoUnknownAndFollowedWhereItIs) {
  std::vector<int> arm = observable_dofs(character_.skeleton, landmarks_), all = arm;
  all.insert(all.end(), wrist_.begin(), wrist_.end());
  const SharedDofs usual{wrist_, found(frames()), 3.0};
  const double straight = tip_error(arm, {}), held = tip_error(arm, usual), followed = tip_error(all, usual);
  RecordProperty("straight_mm", std::to_string(1e3 * straight));
  RecordProperty("held_mm", std::to_string(1e3 * held));
  RecordProperty("followed_mm", std::to_string(1e3 * followed));
  EXPECT_GT(straight, 0.1);
  EXPECT_LT(held, 0.05);
  EXPECT_LT(followed, 0.02);
  EXPECT_LT(followed, held);
}

TEST_F(BentWrist, SaysWhatHasNoUsualValue) {
  const auto ask = [&](const std::vector<int>& dofs, const std::vector<PosedEvidence>& frames) {
    fit_shared_dofs(character_, landmarks_, cameras_, dofs, frames, MultiviewOptions());
  };
  EXPECT_THAT(message_of<UsageError>([&] { ask({dof("rotate_y")}, frames()); }),
              ::testing::HasSubstr("rotate_y moves the whole body"));
  EXPECT_THAT(message_of<Error>([&] { ask(wrist_, {}); }), ::testing::HasSubstr("no frame to find usual values from"));
}

TEST_F(BentWrist, WithoutMasksStaysInTheRestPose) {
  std::vector<PosedEvidence> blind = frames();
  for (PosedEvidence& frame : blind)
    for (ViewEvidence& view : frame.seen) view.outline = {};
  const std::vector<double> values = found(blind);
  for (std::size_t i = 0; i < wrist_.size(); ++i) EXPECT_NEAR(values[i], character_.rest_dofs[wrist_[i]], 1e-9);
}

}  // namespace
}  // namespace doppel::usual_fit_test
