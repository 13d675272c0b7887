#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "doppel/character/motion.h"
#include "doppel/core/as_size.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/track_capture.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::real_track_test {
namespace {

/// The test movement of the shared capture, from keypoints and masks alone.
class RealTracking : public support::SharedFolderTest {
 protected:
  /// @param frames 0: all
  static TrackOptions of_testing(const support::TemporaryFolder& folder, long frames = 0) {
    TrackOptions options;
    options.out = folder.path();
    options.sequences = {"testing"};
    options.limit_frames = frames;
    return options;
  }
  /// Those that follow a hand's own bone most.
  static std::vector<int> hand_vertices(const Character& character) {
    std::vector<int> vertices;
    for (int v = 0; v < character.num_vertices(); ++v) {
      const auto first = as_size(character.skin.vertex_bones.offsets[v]);
      const auto begin = character.skin.weights.begin() + static_cast<std::ptrdiff_t>(first);
      const auto largest = std::max_element(begin, begin + character.skin.vertex_bones.size(v));
      const int bone = character.skin.vertex_bones.items[first + as_size(largest - begin)];
      const auto joint = as_size(character.bone_joint[bone]);
      if (character.skeleton.joints[joint].name.find("Hand") != std::string::npos) vertices.push_back(v);
    }
    return vertices;
  }
};

TEST_F(RealTracking, FindsTheGivenMotion) {
  const support::TemporaryFolder folder;
  const TrackOptions options = of_testing(folder);
  const auto footage = Footage::open(capture_folder(), options.config.fit.outline_pixels);
  const auto report = to_json(track_capture(*footage, options));
  const auto& testing = report["sequences"]["testing"];
  const auto& difference = testing["against_given_motion"];
  const double mean = difference["landmarks_mm"], within = difference["3DPCK"];
  RecordProperty("landmarks_mm", std::to_string(mean));
  RecordProperty("MPJPE_mm", std::to_string(difference["MPJPE_mm"].get<double>()));
  RecordProperty("frames_per_second", std::to_string(testing["frames_per_second"].get<double>()));
  EXPECT_LT(mean, 25.0);
  EXPECT_GE(within, 99.0);
  EXPECT_EQ(testing["lost_frames"].size(), 0u);
  EXPECT_EQ(testing["initialised"], 1);
}

/// No landmark tells anything of the hands, and outlines of a frame alone turned them over now and then. How far they
/// are from those of the given motion, without each vertex's mean offset, which training learns by itself.
TEST_F(RealTracking, HandsMoveAsInTheGivenMotion) {
  const support::TemporaryFolder folder;
  TrackOptions options = of_testing(folder, 20);
  options.sheet_frames = 0;
  options.config =
      read_track_config(ConfigDocument::load(std::string(DOPPEL_SOURCE_DIR) + "/configs/track/skeletool107.yaml"));
  const auto footage = Footage::open(capture_folder(), options.config.fit.outline_pixels);
  const auto report = to_json(track_capture(*footage, options));
  EXPECT_EQ(report["usual"].size(), 38u);

  const Character& character = footage->character();
  const PoseModel model(character, {}, {});
  const Motion found = read_motion(folder.path() / "testing.motion", character.num_dofs());
  const Motion given =
      read_motion(capture_folder() / "testing/skeletoolToGTPose/poseAngles.motion", character.num_dofs());
  double sum = 0.0, count = 0.0;
  const std::vector<int> hands = hand_vertices(character);
  ASSERT_GT(hands.size(), 20u);
  std::vector<PosedBody> is, wanted;
  for (std::size_t f = 0; f < 20; ++f) {
    is.push_back(model.pose(found.frames[f], false));
    wanted.push_back(model.pose(given.frames[f], false));
  }
  for (const int v : hands) {
    std::vector<Eigen::Vector3d> offsets;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t f = 0; f < 20; ++f) {
      const Eigen::Vector3d offset = model.vertex(is[f], v) - model.vertex(wanted[f], v);
      offsets.push_back(model.movement(wanted[f], v).linear().transpose() * offset);
      mean += offsets.back() / 20.0;
    }
    for (const Eigen::Vector3d& offset : offsets) sum += (offset - mean).norm(), ++count;
  }
  RecordProperty("varying_mm", std::to_string(1e3 * sum / count));
  EXPECT_LT(sum / count, 0.012);
}

/// Loose clothes: the pose alone leaves a tenth of the masks open, the bent surface nearly nothing.
TEST_F(RealTracking, BendsTheSurfaceToTheMasks) {
  const support::TemporaryFolder folder;
  TrackOptions options = of_testing(folder, 4);
  options.surface = true;
  const auto footage = Footage::open(capture_folder(), options.config.fit.outline_pixels);
  const auto report = to_json(track_capture(*footage, options));
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
  const auto report = to_json(track_livecap(*footage, options));
  const auto& wild = report["sequences"]["wild"];
  EXPECT_EQ(wild["lost_frames"].size(), 0u);
  const double pose = wild["livecap"]["IoU_pose"], surface = wild["livecap"]["IoU"];
  RecordProperty("IoU_pose", std::to_string(pose));
  RecordProperty("IoU", std::to_string(surface));
  EXPECT_GE(surface, 0.92);
  EXPECT_GE(surface, pose + 0.02);
}

}  // namespace
}  // namespace doppel::real_track_test
