// The commands that mend a rig, on a capture of a person who was never drawn: cameras and keypoint files are enough.
#include "calibrate_rig.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calibration/estimation/drawn_board.h"
#include "calibration/estimation/rig_error.h"
#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/capture.h"
#include "run_program.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/oriented_image.h"
#include "support/temporary_folder.h"

namespace doppel::tools::calibrate_rig_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// The walker's points among those of BODY_25.
constexpr std::array<int, support::kWalkerPoints> kInBody25{0, 1, 8, 5, 6, 7, 2, 3, 4, 12, 13, 14, 9, 10, 11};

class CalibrateRig : public ::testing::Test {
 protected:
  /// Writes what the cameras film, with a calibration that may be another.
  void write(const std::vector<Camera>& ground_truth, const std::vector<Camera>& calibrated,
             const support::FilmOptions& options) const {
    write_calibration(path("cameras.yml"), calibrated);
    const PointTracks tracks = support::film(ground_truth, support::walker, options);
    for (const CameraTrack& track : tracks.cameras) {
      fs::create_directories(path("keypoints") / track.name);
      for (long frame = 0; frame < track.num_frames(); ++frame) {
        std::vector<double> numbers(75, 0.0);
        for (int k = 0; k < support::kWalkerPoints; ++k) {
          const TrackPoint& point = track.at(frame, k);
          const auto at = static_cast<std::size_t>(3 * kInBody25[static_cast<std::size_t>(k)]);
          if (point.seen())
            numbers[at] = point.pixel.x(), numbers[at + 1] = point.pixel.y(), numbers[at + 2] = point.confidence;
        }
        const json people{{"people", json::array({json{{"pose_keypoints_2d", numbers}}})}};
        std::ofstream(path("keypoints") / track.name / fmt::format("{:04}_keypoints.json", frame)) << people;
      }
    }
    std::ofstream(path("capture.yaml"))
        << "doppel_capture: 1\nname: walk\ncalibration: cameras.yml\nfps: 25\nkeypoint_map: body25\nsequences:\n"
           "  - {name: take, split: train, videos: 'videos/{name}.mp4', last_frame: "
        << options.frames - 1 << ", keypoints: 'keypoints/{name}/{frame:04}_keypoints.json'}\n";
  }
  fs::path path(const std::string& name) const { return folder_ / name; }

  support::TemporaryFolder folder_;
};

TEST_F(CalibrateRig, SyncWritesOffsets) {
  const std::vector<Camera> cameras = support::rig_of(4, 800);
  support::FilmOptions options;
  options.frames = 120;
  options.offset = {0.0, 7.3, -4.4, 2.2};
  write(cameras, cameras, options);
  const Outcome found = run_words({"calibrate", "sync", path("capture.yaml"), "--json"});
  ASSERT_EQ(found.code, 0) << found.err;
  const json report = json::parse(found.out);
  EXPECT_EQ(report.at("sequence"), "take");
  EXPECT_EQ(report.at("reference"), "c0");
  const Capture mended = read_capture(path("capture_synced.yaml"));
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    EXPECT_TRUE(report.at("cameras")[c].at("known"));
    EXPECT_NEAR(report.at("cameras")[c].at("frame_offset"), options.offset[c], 0.1);
    EXPECT_NEAR(mended.clock(mended.sequences[0], cameras[c].name).offset, options.offset[c], 0.1);
  }
  // Row 5 is the first that camera c2 filmed, row 111 the last that camera c1 filmed.
  EXPECT_EQ(mended.sequences[0].first_frame, 5);
  EXPECT_EQ(mended.sequences[0].last_frame, 111);

  // A second sequence would replace the offsets of the first, unless it begins with them.
  std::ofstream(path("capture.yaml"), std::ios::app)
      << "  - {name: again, split: test, videos: 'videos/{name}.mp4', last_frame: 119, "
         "keypoints: 'keypoints/{name}/{frame:04}_keypoints.json'}\n";
  const Outcome lost = run_words({"calibrate", "sync", path("capture.yaml"), "--sequence", "again"});
  EXPECT_EQ(lost.code, 2);
  EXPECT_THAT(lost.err, HasSubstr("other offsets of the sequence take"));

  const Outcome wrong = run_words({"calibrate", "sync", path("capture.yaml"), "--reference", "c9"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("no camera c9"));
  EXPECT_EQ(run_words({"calibrate", "sync", path("capture.yaml"), "--sequence", "other"}).code, 2);
  const Outcome silent = run_words({"calibrate", "sync", path("capture.yaml"), "--audio"});
  EXPECT_EQ(silent.code, 1);
  EXPECT_THAT(silent.err, HasSubstr("no such file"));
}

TEST_F(CalibrateRig, RefineWritesACalibration) {
  const std::vector<Camera> ground_truth = support::rig_of(5, 800);
  support::FilmOptions options;
  options.frames = 200;
  write(ground_truth, support::disturbed(ground_truth, 1.5, 0.04, 3), options);
  const Outcome found = run_words({"calibrate", "refine", path("capture.yaml"), "--json"});
  ASSERT_EQ(found.code, 0) << found.err;
  const json report = json::parse(found.out);
  EXPECT_LT(report.at("median_after_px"), 0.4 * report.at("median_before_px").get<double>());
  EXPECT_TRUE(report.at("moved").empty());
  const support::RigError error = support::error_of(read_calibration(path("cameras_refined.yml")), ground_truth);
  EXPECT_LT(error.degrees, 0.1);
  EXPECT_LT(error.metres, 0.003);
  const Outcome table =
      run_words({"calibrate", "refine", path("capture.yaml"), "--focal", "--out", path("other.toml")});
  ASSERT_EQ(table.code, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("px after"));
  EXPECT_EQ(read_calibration(path("other.toml")).size(), ground_truth.size());
  EXPECT_THAT(table.out, Not(HasSubstr("key `")));
}

TEST_F(CalibrateRig, RefineSaysWhichKeysWouldChangeItsResult) {
  const std::vector<Camera> cameras = support::rig_of(3, 800);
  support::FilmOptions options;
  options.frames = 60;
  write(cameras, cameras, options);
  std::ofstream(path("capture.yaml"), std::ios::app) << "unit: m\nup: +z\n";
  const Outcome found = run_words({"calibrate", "refine", path("capture.yaml"), "--points-only"});
  ASSERT_EQ(found.code, 0) << found.err;
  EXPECT_THAT(found.out, AllOf(HasSubstr("key `up` would change"), HasSubstr("capture amend --calibration")));
}

TEST_F(CalibrateRig, RefineRefusesBeforeItWorks) {
  const std::vector<Camera> cameras = support::rig_of(3, 800);
  support::FilmOptions options;
  options.frames = 60;
  write(cameras, cameras, options);
  std::vector<std::string> words{"calibrate", "refine", path("capture.yaml")};
  for (const Camera& camera : cameras) words.insert(words.end(), {"--fix", camera.name});
  const Outcome fixed = run_words(words);
  EXPECT_EQ(fixed.code, 2);
  EXPECT_THAT(fixed.err, HasSubstr("all 3 cameras are fixed"));
  fs::remove_all(path("keypoints"));  // the extension is refused before they are missed
  const Outcome extension = run_words({"calibrate", "refine", path("capture.yaml"), "--out", path("y.txt")});
  EXPECT_EQ(extension.code, 1);
  EXPECT_THAT(extension.err, HasSubstr("found the extension \".txt\""));
}

TEST_F(CalibrateRig, AResultThatCannotBeWrittenIsWrittenBeside) {
  std::vector<Camera> cameras = support::rig_of(2, 800);
  cameras[0].name = "two words";
  EXPECT_THAT(support::message_of<Error>([&] { write_result(path("x.calibration"), cameras); }),
              AllOf(HasSubstr("must be one word"), HasSubstr("x.calibration.yml instead")));
  EXPECT_EQ(read_calibration(path("x.calibration.yml")).size(), 2U);
}

/// Pose of the board of one view.
auto board_pose(int view, const Board& board) {
  const double a = 1.3 * view;
  return support::facing({0.05 * std::sin(2.1 * a), 0.03 * std::cos(1.7 * a), 0.55}, {0, 0, 0},
                         0.4 * std::sin(1.1 * a + 0.5), 0.4 * std::cos(0.9 * a), 0.2 * std::sin(3.0 * a), board);
}

Camera board_camera(const std::string& name) {
  Camera camera;
  camera.name = name;
  camera.width = 400;
  camera.height = 300;
  camera.K << 430, 0, 200, 0, 430, 150, 0, 0, 1;
  return camera;
}

TEST_F(CalibrateRig, BoardCalibratesFromFoldersOfImages) {
  const Board board = parse_board("chessboard:5x4:40mm");
  std::vector<Camera> ground_truth{board_camera("left"), board_camera("right")};
  for (std::size_t c = 0; c < 2; ++c) {
    ground_truth[c].R = Eigen::AngleAxisd(c == 0 ? 0.1 : -0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
    ground_truth[c].t = -ground_truth[c].R * Eigen::Vector3d(c == 0 ? -0.06 : 0.06, 0.0, 0.0);
    fs::create_directories(path(ground_truth[c].name));
    for (int view = 0; view < 8; ++view)
      cv::imwrite((path(ground_truth[c].name) / fmt::format("view_{}.png", view)).string(),
                  support::drawn_board(ground_truth[c], board_pose(view, board), support::chessboard_paint(board), 3));
  }
  const Outcome found = run_words({"calibrate", "board", path("left"), path("right"), "--board", "chessboard:5x4:40mm",
                                   "--out", path("cameras.toml"), "--json"});
  ASSERT_EQ(found.code, 0) << found.err;
  const json report = json::parse(found.out);
  const std::vector<Camera> cameras = read_calibration(path("cameras.toml"));
  ASSERT_EQ(cameras.size(), 2U);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(cameras[c].name, ground_truth[c].name);
    EXPECT_TRUE(report.at("cameras")[c].at("posed"));
    EXPECT_NEAR(cameras[c].K(0, 0) / ground_truth[c].K(0, 0), 1.0, 0.01);
  }
  EXPECT_NEAR((cameras[0].centre() - cameras[1].centre()).norm(), 0.12, 0.003);
  const Outcome wrong =
      run_words({"calibrate", "board", path("left"), "--board", "chessboard:5x4", "--out", path("c.toml")});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("is no board"));
  // Before the first image is read: the folder holds none.
  fs::create_directories(path("empty"));
  const Outcome target = run_words(
      {"calibrate", "board", path("empty"), "--board", "chessboard:5x4:40mm", "--out", path("cameras.calibration")});
  EXPECT_EQ(target.code, 2);
  EXPECT_THAT(target.err, HasSubstr("cannot hold lens distortion"));
}

// As footage: the camera of the calibration is the one whose images are shown upright.
TEST_F(CalibrateRig, BoardObeysExifOrientations) {
  const Board board = parse_board("chessboard:5x4:40mm");
  const Camera camera = board_camera("phone");
  fs::create_directories(path("phone"));
  const auto write = [&](int view, int orientation) {
    const cv::Mat shown = support::drawn_board(camera, board_pose(view, board), support::chessboard_paint(board), 3);
    support::write_bytes(path("phone") / fmt::format("view_{}.png", view),
                         support::oriented_file(shown, ".png", orientation));
  };
  for (int view = 0; view < 8; ++view) write(view, 6);
  const std::vector<std::string> words{"calibrate",           "board", path("phone"),    "--board",
                                       "chessboard:5x4:40mm", "--out", path("phone.yml")};
  const Outcome found = run_words(words);
  ASSERT_EQ(found.code, 0) << found.err;
  // One camera alone has no pose.
  const Calibration alone = load_calibration(path("phone.yml"));
  EXPECT_FALSE(alone.has_poses);
  const Camera calibrated = alone.cameras.at(0);
  EXPECT_EQ(cv::Size(calibrated.width, calibrated.height), cv::Size(400, 300));
  EXPECT_NEAR(calibrated.K(0, 2), camera.K(0, 2), 4.0);
  EXPECT_NEAR(calibrated.K(1, 2), camera.K(1, 2), 4.0);

  write(5, 3);
  const Outcome mixed = run_words(words);
  EXPECT_EQ(mixed.code, 1);
  EXPECT_THAT(mixed.err, HasSubstr("view_5.png: its EXIF orientation is 3, that of earlier images of this camera 6"));
}

}  // namespace
}  // namespace doppel::tools::calibrate_rig_test
