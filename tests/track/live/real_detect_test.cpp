#include <gtest/gtest.h>

#include "doppel/character/motion.h"
#include "doppel/track/live/live_run.h"
#include "doppel/track/method_trackers.h"
#include "support/blazepose_weights.h"
#include "support/temporary_folder.h"

namespace doppel::real_detect_test {
namespace {

/// One camera of the shared capture.
class RealRawVideo : public support::BlazePoseTest {
 protected:
  /// The differences of the tracked from the given motion. Keypoints, 3D joints and masks are those of BlazePose.
  MotionDifference track(const LivecapConfig& config) const {
    const support::TemporaryFolder out;
    const auto source = open_source((capture_folder() / "testing/videos/stream000.mp4").string());
    LiveViewOptions seeing;
    seeing.camera = "0";
    seeing.sequence = "testing";
    seeing.blazepose = BlazePoseModel::full;
    LiveView view(capture_folder(), source->size(), seeing);
    const auto tracker = make_livecap_tracker(view.character(), view.landmarks(), view.camera(), config);
    LiveRunOptions options;
    options.out = out.path();
    const TrackReport report = track_live(*source, view, *tracker, options);
    EXPECT_TRUE(report.sequences.at(0).lost_frames().empty());
    const int dofs = view.character().num_dofs();
    const Motion found = read_motion(out / "live.motion", dofs);
    const Motion given = read_motion(capture_folder() / "testing/skeletoolToGTPose/poseAngles.motion", dofs);
    EXPECT_EQ(found.num_frames(), given.num_frames());
    return compare_motions(view.character().skeleton, view.landmarks(), found, given, 0, given.num_frames() - 1);
  }
};

TEST_F(RealRawVideo, IsTrackedWithoutKeypointsAndMasks) {
  LivecapConfig without_joints;
  without_joints.fit.joint_weight = 0.0;
  const double aligned_mm = track(LivecapConfig()).aligned_landmarks_mm;
  const double aligned_mm_without_joints = track(without_joints).aligned_landmarks_mm;
  RecordProperty("aligned_mm", std::to_string(aligned_mm));
  RecordProperty("aligned_mm_without_joints", std::to_string(aligned_mm_without_joints));
  // 40 and 85 mm were measured. One camera's keypoints and masks do not show the depth of limbs: 3D joints do.
  EXPECT_LT(aligned_mm, 60.0);
  EXPECT_LT(aligned_mm, aligned_mm_without_joints);
}

}  // namespace
}  // namespace doppel::real_detect_test
