#include <gtest/gtest.h>

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

}  // namespace
}  // namespace doppel
