#include "doppel/track/points/track_points.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "doppel/track/points/point_files.h"
#include "support/message_of.h"
#include "support/reference_points.h"
#include "support/ring_of_cameras.h"
#include "support/shared_folder.h"
#include "track/tube_capture.h"

namespace doppel::track_points_test {
namespace {

using Eigen::Vector3d;
using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

constexpr int kPoints = 3, kRows = 40;
constexpr double kFps = 50.0;

Vector3d true_point(int k, double row) {
  return {0.3 * k + 0.2 * std::sin(0.08 * row), 1.0 + 0.1 * k, 0.3 * std::cos(0.06 * row + k)};
}

/// What four cameras saw, with noise; the third has one frame per two rows and began a frame late.
struct SeenPoints {
  std::vector<Camera> cameras;
  std::vector<FrameClock> clocks;
  PointTracks tracks;

  explicit SeenPoints(double noise) {
    std::mt19937 random(3);
    std::normal_distribution<double> error(0.0, noise);
    for (int k = 0; k < kPoints; ++k) tracks.points.push_back("p" + std::to_string(k));
    for (const PinholeCamera& camera : ring_of_cameras(4, 1000, {0.3, 1.0, 0.0})) {
      cameras.push_back(camera);
      cameras.back().distortion = {-0.08, 0.01};
      clocks.push_back(cameras.size() == 3 ? FrameClock{0.5, 1.0} : FrameClock{});
      const FrameClock& clock = clocks.back();
      CameraTrack track(camera.name, kFps * clock.rate, kRows + 2, kPoints);
      track.offset = clock.offset;
      for (long frame = 0; frame < track.num_frames(); ++frame)
        for (int k = 0; k < kPoints; ++k) {
          const Eigen::Vector2d pixel =
              cameras.back().project(true_point(k, (static_cast<double>(frame) - clock.offset) / clock.rate));
          track.at(frame, k) = {pixel + Eigen::Vector2d(error(random), error(random)), 0.9};
        }
      tracks.cameras.push_back(std::move(track));
    }
  }
  PointMotion motion(const PointMotionOptions& options = {}) const {
    return triangulate_tracks(tracks, cameras, clocks, kFps, 0, kRows - 1, options);
  }
};

double largest_error(const PointMotion& motion) {
  double largest = 0.0;
  for (std::size_t f = 0; f < motion.frames.size(); ++f)
    for (int k = 0; k < kPoints; ++k)
      if (const auto& point = motion.frames[f][k])
        largest = std::max(largest, (*point - true_point(k, static_cast<double>(f))).norm());
  return largest;
}

TEST(PointMotion, IsThatOfTheBodyWhateverTheClocks) {
  const PointMotion motion = SeenPoints(0.0).motion();
  EXPECT_EQ(motion.found(), 1.0);
  EXPECT_LT(largest_error(motion), 1e-3) << "between two frames, points move in lines";
  for (const PointCamera& camera : motion.cameras) {
    EXPECT_EQ(camera.agreeing, camera.seen) << camera.name;
    EXPECT_LT(camera.residual_px, 0.2) << camera.name;
  }
}

TEST(PointMotion, ACameraThatSeesAnotherPersonDoesNoHarm) {
  SeenPoints seen(0.0);
  for (long frame = 5; frame < 25; ++frame)
    for (int k = 0; k < kPoints; ++k) seen.tracks.cameras[1].at(frame, k).pixel.x() += 200.0;
  const PointMotion motion = seen.motion();
  EXPECT_LT(largest_error(motion), 1e-3);
  EXPECT_EQ(motion.cameras[1].seen - motion.cameras[1].agreeing, 20 * kPoints);
  EXPECT_EQ(motion.cameras[0].seen, motion.cameras[0].agreeing);
}

TEST(PointMotion, OfTwoHalvesOfTheCamerasTheOneThatGoesOn) {
  SeenPoints seen(0.0);
  for (const std::size_t c : {0u, 1u})
    for (long frame = 10; frame < 20; ++frame)
      for (int k = 0; k < kPoints; ++k)
        seen.tracks.cameras[c].at(frame, k).pixel =
            seen.cameras[c].project(true_point(k, static_cast<double>(frame)) + Vector3d(0.3, 0.0, 0.0));
  // One camera of the wrong half sees the shift as 38 pixels only. The kernel lets such a view pull a little.
  EXPECT_LT(largest_error(seen.motion()), 0.02);
}

TEST(PointMotion, ACameraThatWasPushedCountsLess) {
  SeenPoints seen(1.0);
  Camera& pushed = seen.cameras[1];
  const Vector3d centre = pushed.centre();
  pushed.R = Eigen::AngleAxisd(0.025, Vector3d::UnitY()).toRotationMatrix() * pushed.R;  // 33 pixels
  pushed.t = -pushed.R * centre;
  PointMotionOptions options;
  options.max_residual = 100.0;
  const double robust = largest_error(seen.motion(options));
  options.kernel = 1e4;
  EXPECT_LT(robust, 0.4 * largest_error(seen.motion(options)));
}

TEST(PointMotion, ShortGapsAreFilledAndNoiseIsSmoothed) {
  SeenPoints seen(2.0);
  const auto hide = [&](int k, long first, long last) {
    for (CameraTrack& camera : seen.tracks.cameras)
      for (long frame = first; frame <= last; ++frame) camera.at(frame, k).confidence = 0.0;
  };
  hide(0, 10, 14);  // of cameras 0, 1 and 3; camera 2 alone fixes no point
  hide(1, 20, 39);
  PointMotionOptions options;
  PointMotion motion = seen.motion(options);
  const auto rms = [&] {
    double sum = 0.0, count = 0.0;
    for (std::size_t f = 0; f < motion.frames.size(); ++f)
      if (const auto& point = motion.frames[f][2]) {
        sum += (*point - true_point(2, static_cast<double>(f))).squaredNorm();
        ++count;
      }
    return std::sqrt(sum / count);
  };
  const double rough = rms();
  EXPECT_FALSE(motion.frames[12][0].has_value());
  fill_and_smooth(motion, {}, options);
  EXPECT_LT(rms(), 0.85 * rough);
  EXPECT_EQ(motion.filled, 5);
  EXPECT_LT((*motion.frames[12][0] - true_point(0, 12)).norm(), 0.02);
  EXPECT_FALSE(motion.frames[30][1].has_value()) << "the gap is longer than 0.2 s, and has no end";

  PointMotion cut = seen.motion(options);
  fill_and_smooth(cut, {12}, options);
  EXPECT_EQ(cut.filled, 0) << "nothing is filled across a cut";
}

TEST(PointMotion, FilesHoldThePointsAndTheGaps) {
  const TemporaryFolder folder;
  PointMotion motion = SeenPoints(0.0).motion();
  motion.first_row = 7;
  motion.frames[3][1] = std::nullopt;
  write_trc(folder / "walk.trc", motion);
  const SpacePoints read = read_space_points(folder / "walk.trc");
  EXPECT_EQ(read.format, "trc");
  EXPECT_EQ(read.rate, kFps);
  EXPECT_EQ(read.names, motion.points);
  ASSERT_EQ(read.frames.size(), as_size(kRows));
  EXPECT_EQ(read.frames.begin()->first, 8) << "frame 1 is row 0";
  for (std::size_t f = 0; f < motion.frames.size(); ++f)
    for (std::size_t k = 0; k < as_size(kPoints); ++k) {
      const auto& point = read.frames.at(8 + static_cast<long>(f))[k];
      ASSERT_EQ(point.has_value(), motion.frames[f][k].has_value());
      if (!point) continue;
      EXPECT_LT((*point - *motion.frames[f][k]).norm(), 1e-6);
    }
  write_point_array(folder / "points.npy", motion);
  const NpyArray array = read_npy(folder / "points.npy");
  EXPECT_EQ(array.shape, (std::vector<std::int64_t>{kRows, kPoints, 3}));
  const std::vector<float> values = array.as<float>();
  EXPECT_TRUE(std::isnan(values[(3 * kPoints + 1) * 3]));
  EXPECT_NEAR(values[4], (*motion.frames[0][1]).y(), 1e-6);
}

/// A body whose character this method does not read.
class TrackPoints : public TrackCapture {
 protected:
  nlohmann::ordered_json tracked() const {
    std::ofstream(root() / "points.yaml")
        << "doppel_capture: 1\nname: tube\ncalibration: cameras.yml\nfps: 50\nsequences:\n"
        << "  - {name: walk, split: test, videos: 'none_{name}.mp4', masks: 'mask_{name}_{frame}.png', "
        << "keypoints: points.csv, cuts: [" << kCut << "]}\n";
    TrackPointsOptions options;
    options.out = root() / "out";
    options.motion.smoothing = 0.0;
    return to_json(track_points(root() / "points.yaml", options));
  }
};

TEST_F(TrackPoints, FindsTheJointsOfABodyWithoutItsCharacter) {
  const auto report = tracked();
  const auto& walk = report["sequences"]["walk"];
  EXPECT_EQ(walk["frames"], kFrames);
  EXPECT_EQ(walk["cameras"].size(), 4u);
  const SpacePoints found = read_space_points(root() / "out/walk.trc");
  ASSERT_EQ(found.names.size(), landmarks_.size());
  for (int frame = 0; frame < kFrames; ++frame) {
    const PosedBody body = model_.pose(ground_truth(frame), false);
    for (std::size_t k = 0; k < found.names.size(); ++k) {
      const auto& point = found.frames.at(frame + 1)[k];
      ASSERT_TRUE(point.has_value()) << "frame 3, in which nobody was detected, is filled";
      const auto m = find_landmark(landmark_names(landmarks_), found.names[k]);
      EXPECT_LT((*point - model_.landmark(body, *m)).norm(), frame == 3 ? 0.03 : 0.002) << "frame " << frame;
    }
  }
  EXPECT_EQ(walk["filled"], landmarks_.size());
  EXPECT_TRUE(std::filesystem::exists(root() / "out/points.npy"));
  EXPECT_TRUE(std::filesystem::exists(root() / "out/track.json"));
}

TEST_F(TrackPoints, SaysWhatIsMissing) {
  TrackPointsOptions options;
  options.out = root() / "out";
  options.sequences = {"dance"};
  EXPECT_THAT(message_of<UsageError>([&] { track_points(root(), options); }), HasSubstr("walk"));
  std::ofstream(root() / "one.yaml")
      << "doppel_capture: 1\ncalibration: cameras.yml\ncameras: [" << cameras_[0].name
      << "]\nsequences: [{name: a, split: test, videos: v, keypoints: points.csv, last_frame: 3}]\n";
  options.sequences.clear();
  EXPECT_THAT(message_of([&] { track_points(root() / "one.yaml", options); }), HasSubstr("at least two"));
}

/// A real man, four cameras, other people in the background; OpenPose's files of all of them, BODY_25B. Nothing was
/// written by hand: `doppel capture init` describes the folder.
class RealPointTracks : public support::SharedFolderTest {};

TEST_F(RealPointTracks, TheRightManIsWhereAnotherProgramFoundHim) {
  const TemporaryFolder folder;
  const std::filesystem::path p2s = shared_ / "captures/p2s";
  write_capture(folder / "capture.yaml", guess_folder(p2s).capture);
  TrackPointsOptions options;
  options.out = folder / "points";
  const TrackPointsReport report = track_points(folder.path(), options);
  EXPECT_GT(report.sequences.at(0).motion.found(), 0.99);
  const SpacePoints found = read_space_points(folder / "points/p2s.trc");
  for (const char* reference : {"triangulated", "filtered"}) {
    const auto [mean, common] = support::distance_from_pose2sim(
        found, read_space_points(p2s / "reference" / ("pose2sim_" + std::string(reference) + ".trc")));
    RecordProperty(reference, std::to_string(1e3 * mean));
    EXPECT_EQ(common, 21u);
    EXPECT_LE(mean, 0.035) << reference;  // 15.8 and 10.7 mm here
  }
}

}  // namespace
}  // namespace doppel::track_points_test
