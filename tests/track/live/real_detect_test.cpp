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
  /// The differences of the tracked from the given motion.
  /// @param model BlazePose instead of the capture's keypoints and masks
  MotionDifference track(std::optional<BlazePoseModel> model) const {
    const support::TemporaryFolder out;
    const auto source = open_source((capture_folder() / "testing/videos/stream000.mp4").string());
    LiveViewOptions seeing;
    seeing.camera = "0";
    seeing.sequence = "testing";
    seeing.blazepose = model;
    LiveView view(capture_folder(), source->size(), seeing);
    const auto tracker = make_livecap_tracker(view.character(), view.landmarks(), view.camera(), LivecapConfig());
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
  const MotionDifference raw = track(BlazePoseModel::full), files = track(std::nullopt);
  RecordProperty("raw_aligned_mm", std::to_string(raw.aligned_landmarks_mm));
  RecordProperty("files_aligned_mm", std::to_string(files.aligned_landmarks_mm));
  // 43 mm were measured. The files have keypoints and exact masks, but no 3D joints: the depth of limbs is a guess
  // then.
  EXPECT_LT(raw.aligned_landmarks_mm, 60.0);
  EXPECT_LT(raw.aligned_landmarks_mm, files.aligned_landmarks_mm);
}

}  // namespace
}  // namespace doppel::real_detect_test
