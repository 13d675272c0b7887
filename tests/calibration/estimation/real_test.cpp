// The example captures: keypoints of a detector's quality, and photographs of a chessboard.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "calibration/estimation/rig_error.h"
#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/estimation/calibrate_board.h"
#include "doppel/calibration/estimation/find_moved_cameras.h"
#include "doppel/calibration/estimation/refine_rig.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/calibration/estimation/synchronise.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/statistics.h"
#include "support/shared_folder.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;
using support::RigError;

constexpr int kBody25 = 25;

class RealRig : public support::SharedFolderTest {
 protected:
  std::vector<Camera> cameras() const {
    return read_calibration(capture_folder() / "calibration" / "cameras.calibration");
  }

  /// The keypoints of a take. @param offset [C] whole frames by which a camera's recording begins too early
  PointTracks tracks(const std::string& take, long frames, const std::vector<long>& offset = {}) const {
    PointTracks result;
    for (int k = 0; k < kBody25; ++k) result.points.push_back(std::to_string(k));
    const std::vector<Camera> all = cameras();
    for (std::size_t c = 0; c < all.size(); ++c) {
      const long shift = offset.empty() ? 0 : offset[c];
      CameraTrack track(all[c].name, 25.0, frames, kBody25);
      for (long frame = 0; frame < frames; ++frame) {
        const long of_file = frame - shift;
        const fs::path file = capture_folder() / take / "keypoints" / fmt::format("{:03}", c) /
                              fmt::format("stream{:03}_{:012}_keypoints.json", c, of_file);
        if (of_file < 0 || !fs::exists(file)) continue;
        std::ifstream stream(file);
        const nlohmann::json people = nlohmann::json::parse(stream).at("people");
        if (people.empty()) continue;
        const std::vector<double> numbers = people[0].at("pose_keypoints_2d");
        for (int k = 0; k < kBody25; ++k)
          track.at(frame, k) = {{numbers[3 * k], numbers[3 * k + 1]}, numbers[3 * k + 2]};
      }
      result.cameras.push_back(std::move(track));
    }
    drop_unusable(result, 0.1);
    return result;
  }

  std::vector<OutlineTrack> outlines(const std::string& take) const {
    std::vector<OutlineTrack> result;
    const std::vector<Camera> all = cameras();
    for (std::size_t c = 0; c < all.size(); ++c) {
      cv::VideoCapture video(
          (capture_folder() / take / "foregroundSegmentation" / fmt::format("stream{:03}.mkv", c)).string());
      OutlineTrack& track = result.emplace_back();
      for (cv::Mat image, mask; video.read(image);) {
        cv::cvtColor(image, mask, cv::COLOR_BGR2GRAY);
        track.push_back(outline_of(mask, all[c]));
      }
    }
    return result;
  }

  /// Points and outlines of both takes.
  std::vector<RigTake> takes() const {
    return {{tracks("training", 160), outlines("training")}, {tracks("testing", 60), outlines("testing")}};
  }
};

/// Delays each camera by a fraction of a frame: its points are interpolated between the frames.
PointTracks delayed(const PointTracks& tracks, const std::vector<double>& by) {
  PointTracks result = tracks;
  for (std::size_t c = 0; c < by.size(); ++c) {
    CameraTrack& track = result.cameras[c];
    for (long f = 0; f < track.num_frames(); ++f)
      for (int k = 0; k < track.num_points(); ++k)
        track.at(f, k) = tracks.cameras[c].sample(static_cast<double>(f) - by[c], k);
  }
  return result;
}

TEST_F(RealRig, RecoversOffsets) {
  const std::vector<double> by{0.0, 7.3, -7.3, 3.7, -1.2, 5.5, -6.4, 0.6};
  for (const auto& [take, frames] : {std::pair<std::string, long>{"training", 80}, {"testing", 60}}) {
    const Synchronisation found = synchronise(cameras(), delayed(tracks(take, frames), by));
    for (std::size_t c = 0; c < by.size(); ++c) {
      std::cout << take << " " << found.cameras[c].name << ": error " << found.cameras[c].offset - by[c] << ", sigma "
                << found.cameras[c].sigma << " frames\n";
      EXPECT_TRUE(found.cameras[c].known) << found.cameras[c].reason;
      // The 60 frames of `testing` last 2.4 s; their standard deviations are 0.1 to 0.2 frames.
      EXPECT_NEAR(found.cameras[c].offset, by[c], take == "training" ? 0.1 : 0.3) << take;
    }
  }
}

/// The outlines of each camera as if it had filmed a whole number of frames later.
std::vector<OutlineTrack> later(std::vector<OutlineTrack> outlines, const std::vector<long>& by) {
  for (std::size_t c = 0; c < by.size(); ++c) {
    OutlineTrack& track = outlines[c];
    const auto size = static_cast<std::ptrdiff_t>(track.size());
    const std::ptrdiff_t shift = by[c];
    OutlineTrack moved(track.size());
    for (std::ptrdiff_t f = std::max<std::ptrdiff_t>(0, shift); f < std::min(size, size + shift); ++f)
      moved[f] = track[f - shift];
    track = std::move(moved);
  }
  return outlines;
}

TEST_F(RealRig, OutlinesSharpenOffsets) {
  const std::vector<long> by{0, 7, -7, 4, -1, 6, -6, 1};
  for (const auto& [take, frames] : {std::pair<std::string, long>{"training", 80}, {"testing", 60}}) {
    std::vector<OutlineTrack> seen = outlines(take);
    for (OutlineTrack& track : seen) track.resize(frames);
    const Synchronisation found = synchronise(cameras(), tracks(take, frames, by), {}, later(seen, by));
    for (std::size_t c = 0; c < by.size(); ++c) {
      std::cout << take << " with outlines " << found.cameras[c].name << ": error "
                << found.cameras[c].offset - static_cast<double>(by[c]) << ", sigma " << found.cameras[c].sigma
                << " frames\n";
      EXPECT_TRUE(found.cameras[c].known) << found.cameras[c].reason;
      EXPECT_NEAR(found.cameras[c].offset, static_cast<double>(by[c]), 0.1) << take;
    }
  }
}

TEST_F(RealRig, RecoversExtrinsics) {
  const std::vector<Camera> ground_truth = cameras();
  const PointTracks seen = tracks("training", 160);
  RefineOptions options;
  options.most_times = 160;
  std::vector<double> at_ground_truth;
  for (const std::vector<double>& of_camera : reprojection_distances(ground_truth, seen, seen.times()))
    at_ground_truth.insert(at_ground_truth.end(), of_camera.begin(), of_camera.end());
  const double ground_truth_median = quantile(at_ground_truth, 0.5);
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const RigRefinement found = refine_rig(support::disturbed(ground_truth, 2.0, 0.05, seed), seen, options);
    const RigError error = support::error_of(found.cameras, ground_truth);
    std::cout << "extrinsics: " << error.degrees << " degrees, " << 1000.0 * error.metres << " mm; sigma "
              << found.reports[1].rotation_sigma * 180.0 / M_PI << " degrees, "
              << 1000.0 * found.reports[1].centre_sigma << " mm; median " << found.median_before << " -> "
              << found.median_after << " px\n";
    // The keypoints allow no 0.1 degrees and 3 mm: half of the variance of their noise lasts from frame to frame, and
    // the true cameras have no smaller residuals than those found. With 220 frames of both takes, 7 mm are left.
    EXPECT_LT(error.degrees, 0.2);
    EXPECT_LT(error.metres, 0.015);
    EXPECT_LT(found.median_after, 1.02 * ground_truth_median);
  }
}

TEST_F(RealRig, OutlinesRecoverExtrinsics) {
  const std::vector<Camera> ground_truth = cameras();
  const std::vector<RigTake> seen = takes();
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const RigError error =
        support::error_of(refine_rig(support::disturbed(ground_truth, 2.0, 0.05, seed), seen).cameras, ground_truth);
    std::cout << "extrinsics by points and outlines: " << error.degrees << " degrees, " << 1000.0 * error.metres
              << " mm\n";
    EXPECT_LT(error.degrees, 0.1);
    EXPECT_LT(error.metres, 0.003);
  }
}

TEST_F(RealRig, OutlinesRecoverFocalLengths) {
  const std::vector<Camera> ground_truth = cameras();
  std::vector<Camera> start = ground_truth;
  for (std::size_t c = 0; c < start.size(); ++c) start[c].K.topLeftCorner<2, 2>() *= c % 2 ? 1.03 : 0.97;
  RefineOptions options;
  options.focal = true;
  const RigRefinement found = refine_rig(start, takes(), options);
  double mean = 0.0;
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    const double error = std::abs(found.cameras[c].K(0, 0) / ground_truth[c].K(0, 0) - 1.0);
    mean += error / static_cast<double>(ground_truth.size());
    EXPECT_LT(error, 0.006) << c;
  }
  std::cout << "focal lengths by points and outlines: " << 100.0 * mean << " % off in the mean\n";
  EXPECT_LT(mean, 0.0035);
}

TEST_F(RealRig, RecoversFocalLengths) {
  const std::vector<Camera> ground_truth = cameras();
  std::vector<Camera> start = ground_truth;
  for (std::size_t c = 0; c < start.size(); ++c) start[c].K.topLeftCorner<2, 2>() *= c % 2 ? 1.03 : 0.97;
  RefineOptions options;
  options.focal = true;
  options.most_times = 160;
  const RigRefinement found = refine_rig(start, tracks("training", 160), options);
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    const double ratio = found.cameras[c].K(0, 0) / ground_truth[c].K(0, 0);
    std::cout << "focal length of " << ground_truth[c].name << ": " << 100.0 * (ratio - 1.0) << " % off, sigma "
              << 100.0 * found.reports[c].focal_sigma << " %\n";
    // A person who fills a third of the image for 6 s: the standard deviations are 0.3 to 0.6 %. They are a little too
    // small, because half of the detector's noise lasts longer than a stretch of the covariance.
    EXPECT_NEAR(ratio, 1.0, 0.02);
    EXPECT_NEAR(ratio, 1.0, 4.5 * found.reports[c].focal_sigma);
  }
}

TEST_F(RealRig, NoCameraMoved) { EXPECT_TRUE(find_moved_cameras(cameras(), tracks("training", 160)).empty()); }

TEST_F(RealRig, IntrinsicsFromPhotographsOfABoard) {
  const fs::path folder = shared_ / "captures" / "p2s";
  const Board board = parse_board("chessboard:4x7:60mm");
  const std::vector<Camera> ground_truth = read_calibration(folder / "calibration.toml");
  for (std::size_t c = 0; c < 4; ++c) {
    BoardSightings seen;
    seen.camera = ground_truth[c].name;
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(folder / "board" / fmt::format("int_cam{:02}_img", c + 1)))
      images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    for (std::size_t i = 0; i < images.size(); ++i) {
      const cv::Mat image = cv::imread(images[i].string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
      seen.width = image.cols;
      seen.height = image.rows;
      if (const auto view = find_board(image, board)) seen.views[static_cast<long>(i)] = *view;
    }
    const CameraIntrinsics found = calibrate_intrinsics(seen, board);
    std::cout << seen.camera << ": " << images.size() << " images of " << seen.width << "x" << seen.height << ", "
              << seen.views.size() << " with the board; focal length " << found.camera.K(0, 0) << " +- "
              << found.focal_sigma << ", reference " << ground_truth[c].K(0, 0) << "; rms " << found.rms << " px\n";
    EXPECT_NEAR(found.camera.K(0, 0) / ground_truth[c].K(0, 0), 1.0, 0.01) << seen.camera;
  }
}

}  // namespace
}  // namespace doppel
