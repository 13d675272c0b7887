#include <gtest/gtest.h>

#include <fstream>

#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/track_capture.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel {
namespace {

/// The test movement of the shared capture, from keypoints and masks alone.
class RealTracking : public support::SharedFolderTest {};

TEST_F(RealTracking, FindsTheGivenMotion) {
  const support::TemporaryFolder folder;
  TrackOptions options;
  options.out = folder.path();
  options.sequences = {"testing"};
  const auto footage = Footage::open(capture_folder(), options.config.fit.outline_pixels);
  const auto report = track_capture(*footage, options);
  const auto& testing = report["sequences"]["testing"];
  const double mean = testing["against_given_motion"]["MPJPE_mm"], within = testing["against_given_motion"]["3DPCK"];
  RecordProperty("MPJPE_mm", std::to_string(mean));
  RecordProperty("frames_per_second", std::to_string(testing["frames_per_second"].get<double>()));
  EXPECT_LT(mean, 25.0);
  EXPECT_GE(within, 99.0);
  EXPECT_EQ(testing["lost_frames"].size(), 0u);
  EXPECT_EQ(testing["initialised"], 1);
}

/// Loose clothes: the pose alone leaves a tenth of the masks open, the bent surface nearly nothing.
TEST_F(RealTracking, BendsTheSurfaceToTheMasks) {
  const support::TemporaryFolder folder;
  TrackOptions options;
  options.out = folder.path();
  options.sequences = {"testing"};
  options.limit_frames = 4;
  options.surface = true;
  const auto footage = Footage::open(capture_folder(), options.config.fit.outline_pixels);
  const auto report = track_capture(*footage, options);
  const auto& surface = report["sequences"]["testing"]["surface"];
  RecordProperty("IoU", std::to_string(surface["IoU"].get<double>()));
  EXPECT_LT(surface["IoU_pose"].get<double>(), 0.92);
  EXPECT_GT(surface["IoU"].get<double>(), 0.955);
}

/// A clip of one camera in which a man walks into the empty scene: what was not tuned for it must hold.
class RealLivecap : public support::SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (IsSkipped()) return;
    std::ofstream(folder_ / "capture.yaml")
        << "doppel_capture: 1\nname: wild\nroot: " << capture_folder().string()
        << "\ncharacter: character/ddc.character\ncalibration: wild/camera.calibration\nlandmarks: landmarks.csv\n"
        << "keypoint_map: body25\nsequences:\n  - name: wild\n    split: test\n    videos: wild/videos/stream000.mp4\n"
        << "    background_subtraction: {frames: [0, 19], refine: false}\n"
        << "    keypoints: 'wild/keypoints/000/stream000_{frame:012}_keypoints.json'\n"
        << "    joints3d: wild/joints3d.csv\n    first_frame: 20\n";
  }
  support::TemporaryFolder folder_;
};

TEST_F(RealLivecap, FollowsAManInLooseClothesWithOneCamera) {
  LivecapCaptureOptions options;
  options.out = folder_ / "tracked";
  options.limit_frames = 20;
  const auto footage = Footage::open(folder_.path(), options.config.fit.outline_pixels);
  const auto report = track_livecap(*footage, options);
  const auto& wild = report["sequences"]["wild"];
  EXPECT_EQ(wild["lost_frames"].size(), 0u);
  const double pose = wild["livecap"]["IoU_pose"], surface = wild["livecap"]["IoU"];
  RecordProperty("IoU_pose", std::to_string(pose));
  RecordProperty("IoU", std::to_string(surface));
  EXPECT_GE(surface, 0.92);
  EXPECT_GE(surface, pose + 0.02);
}

}  // namespace
}  // namespace doppel
