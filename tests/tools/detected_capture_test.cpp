#include "detected_capture.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "doppel/track/points/track_points.h"
#include "support/blazepose_weights.h"
#include "support/message_of.h"
#include "support/reference_points.h"
#include "support/temporary_folder.h"

namespace doppel::tools::detected_capture_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

constexpr char kCameras[] =
    "%YAML:1.0\n---\ncam0:\n   name: \"0\"\n   width: 16\n   height: 16\n   K: [ 20, 0, 8, 0, 20, 8, 0, 0, 1 ]\n"
    "   dist: [ 0, 0, 0, 0 ]\n   R: [ 1, 0, 0, 0, -1, 0, 0, 0, -1 ]\n   t: [ 0, 1, 4 ]\n";

/// A capture of one camera named "0" and two sequences; the second has masks.
class CaptureToDetect : public ::testing::Test {
 protected:
  CaptureToDetect() {
    fs::create_directories(root() / "footage");
    write_atomically(root() / "footage/cameras.yml", kCameras);
    write_atomically(root() / "footage/a.mp4", "no video");
    write("");
  }
  void write(const std::string& more) const {
    write_atomically(root() / "footage/capture.yaml",
                     "doppel_capture: 1\nname: anna\ncalibration: cameras.yml\n"
                     "sequences:\n  - {name: a, split: train, videos: a.mp4" +
                         more + "}\n  - {name: b, split: test, videos: b.mp4, masks: 'm{frame}.png'}\n");
  }
  fs::path root() const { return folder_.path(); }
  fs::path capture() const { return root() / "footage"; }
  nlohmann::ordered_json report(const fs::path& out, bool masks) const {
    nlohmann::ordered_json report{{"layout", "mediapipe33"}, {"cameras", nlohmann::ordered_json::array()}};
    for (const std::string sequence : {"a", "b"})
      report["cameras"].push_back({{"sequence", sequence},
                                   {"camera", "0"},
                                   {"keypoints", (out / sequence / "0.csv").string()},
                                   {"joints3d", (out / sequence / "0_joints3d.csv").string()},
                                   {"masks", masks ? (out / sequence / "masks/0").string() : ""}});
    return report;
  }
  /// Without files of networks and videos, a detection would fail.
  fs::path with(const DetectNeeds& needs) const {
    return with_keypoints(capture(), root() / "out", needs, CommonOptions());
  }
  TemporaryFolder folder_;
};

TEST_F(CaptureToDetect, ResultsAreACaptureAgain) {
  const fs::path inside = capture() / "detected";
  write_detected_capture(capture(), inside, report(inside, true));
  const Capture found = read_capture(inside);
  EXPECT_EQ(found.keypoint_map, "mediapipe33");
  EXPECT_EQ(found.sequences[0].keypoints, "detected/a/{name}.csv");
  EXPECT_EQ(found.sequences[0].joints3d, "detected/a/{name}_joints3d.csv");
  EXPECT_EQ(found.sequences[0].masks, "detected/a/masks/{name}/{frame:06}.png");
  EXPECT_EQ(found.sequences[1].masks, "m{frame}.png") << "a sequence keeps its own masks";
  EXPECT_EQ(found.source(found.sequences[0].keypoints, 0, "0"), (capture() / "detected/a/0.csv").string());

  const fs::path outside = root() / "elsewhere";
  write_detected_capture(capture(), outside, report(outside, false));
  const Capture other = read_capture(outside);
  EXPECT_EQ(other.source(other.sequences[1].keypoints, 0, "0"), (outside / "b/0.csv").string());
  EXPECT_FALSE(other.sequences[0].has_masks());
  EXPECT_TRUE(fs::equivalent(other.calibration_path(), capture() / "cameras.yml"));
}

TEST_F(CaptureToDetect, ResultsCountFramesAsTheVideosDo) {
  write(", keypoints: 'k{frame}.json', keypoint_offset: {\"0\": 5}");
  write_detected_capture(capture(), root() / "out", report(root() / "out", false));
  EXPECT_TRUE(read_capture(root() / "out").sequences[0].keypoint_offset.empty());
  write_detected_capture(capture(), root() / "kept", report(root() / "kept", false), true);
  EXPECT_EQ(read_capture(root() / "kept").sequences[0].keypoint_offset_of("0"), 5);
}

// The keypoints are those of the chosen person alone; the index of another detection would be out of range.
TEST_F(CaptureToDetect, ResultsDoNotNameAPerson) {
  write(", keypoints: k.csv, person: 1");
  write_detected_capture(capture(), root() / "out", report(root() / "out", false));
  EXPECT_FALSE(read_capture(root() / "out").sequences[0].person);
  write_detected_capture(capture(), root() / "out", report(root() / "out", false), true);
  EXPECT_EQ(read_capture(root() / "out").sequences[0].person->person, 1) << "with the keypoints of the capture";
}

TEST_F(CaptureToDetect, VideosHaveNoDescription) {
  write_detected_capture(capture() / "a.mp4", root() / "out", report(root() / "out", false));
  EXPECT_FALSE(fs::exists(root() / "out/capture.yaml"));
  EXPECT_THAT(message_of<UsageError>([&] { check_detect_out(capture(), capture()); }), HasSubstr("--out"));
  check_detect_out(capture(), root() / "out");
  check_detect_out(capture() / "a.mp4", capture());
}

TEST_F(CaptureToDetect, KeypointsOfTheCaptureOrOfAnEarlierRunAreUsed) {
  EXPECT_THAT(message_of<Error>([&] { with({false, true}); }), HasSubstr("names no character"));
  write_detected_capture(capture(), root() / "out", report(root() / "out", false));
  EXPECT_EQ(with({}), root() / "out/capture.yaml");
  EXPECT_ANY_THROW(with({true, false})) << "masks are needed, and the earlier run has none";
  fs::copy(capture(), root() / "another");
  EXPECT_ANY_THROW(with_keypoints(root() / "another", root() / "out", {}, CommonOptions())) << "another capture's";
  fs::last_write_time(root() / "footage/a.mp4", fs::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_ANY_THROW(with({})) << "the video is newer";
  write(", keypoints: k.csv");
  EXPECT_EQ(with({true, false}), capture());
}

/// A real man in four real videos with a calibration, nothing else.
using RealDetectedCapture = support::BlazePoseTest;

// BlazePose and OpenPose see the same joint at different points of the body, the hips 55 mm apart.
TEST_F(RealDetectedCapture, VideosAndACalibrationGiveTheManInSpace) {
  const TemporaryFolder folder;
  const fs::path p2s = shared_ / "captures/p2s";
  fs::create_directories(folder / "films");
  fs::create_directory_symlink(p2s / "videos", folder / "films/videos");
  fs::create_symlink(p2s / "calibration.toml", folder / "films/calibration.toml");
  Capture capture = guess_folder(folder / "films").capture;
  capture.sequences.at(0).name = "walk";
  write_capture(folder / "films/capture.yaml", capture);
  TrackPointsOptions options;
  options.out = folder / "points";
  track_points(with_keypoints(folder / "films", folder / "detected", {}, CommonOptions()), options);
  const auto [mean, common] = support::distance_from_pose2sim(
      read_space_points(folder / "points/walk.trc"), read_space_points(p2s / "reference/pose2sim_filtered.trc"));
  RecordProperty("mean_mm", std::to_string(1e3 * mean));
  EXPECT_EQ(common, 15u);
  EXPECT_LE(mean, 0.035);
}

}  // namespace
}  // namespace doppel::tools::detected_capture_test
