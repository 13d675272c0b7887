#include "doppel/calibration/estimation/outline_tracks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "calibration/estimation/rig_error.h"
#include "calibration/estimation/walking_outlines.h"
#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/calibration/estimation/refine_rig.h"
#include "doppel/calibration/estimation/synchronise.h"
#include "doppel/core/statistics.h"

namespace doppel {
namespace {

using Eigen::Vector2d;
using support::outlines_of;
using support::rig_of;
using support::walker;

Camera camera_of(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.K << 300.0, 0.0, 0.5 * width, 0.0, 300.0, 0.5 * height, 0.0, 0.0, 1.0;
  return camera;
}

/// A pixel belongs to the mask if its centre lies in the circle.
cv::Mat disc(int size, const Vector2d& centre, double radius) {
  cv::Mat mask = cv::Mat::zeros(size, size, CV_8UC1);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      if ((Vector2d(x + 0.5, y + 0.5) - centre).norm() <= radius) mask.at<uchar>(y, x) = 255;
  return mask;
}

TEST(OutlineTracks, OutlineOfADiscTouchesTheCircle) {
  const Vector2d centre(70.3, 61.8);
  const Outline outline = outline_of(disc(140, centre, 40.0), camera_of(140, 140));
  ASSERT_GT(outline.hull.size(), 20U);
  for (const Outline::Corner& corner : outline.hull) {
    EXPECT_NEAR((corner.pixel - centre).norm(), 40.0, 0.5);
    EXPECT_FALSE(corner.on_border);
  }
}

TEST(OutlineTracks, OutlineAtTheBorderSaysSo) {
  const Outline outline = outline_of(disc(100, {95.0, 50.0}, 20.0), camera_of(100, 100));
  for (const Outline::Corner& corner : outline.hull) EXPECT_EQ(corner.on_border, corner.pixel.x() > 98.0);
  EXPECT_TRUE(outline_of(cv::Mat::zeros(20, 20, CV_8UC1), camera_of(20, 20)).hull.empty());
}

TEST(OutlineTracks, OutlineIsInPixelsAsFilmed) {
  Camera camera = camera_of(140, 140);
  camera.distortion[0] = -0.2;
  const Outline outline = outline_of(disc(140, {70.0, 70.0}, 60.0), camera);
  const double edge = 60.0 / 300.0, filmed = 300.0 * edge * (1.0 - 0.2 * edge * edge);
  for (const Outline::Corner& corner : outline.hull)
    EXPECT_NEAR((corner.pixel - Vector2d(70.0, 70.0)).norm(), filmed, 0.6);
}

TEST(OutlineTracks, FrontierPointsLieOnEpipolarLines) {
  std::vector<Camera> cameras = rig_of(6, 1000);
  for (Camera& camera : cameras) camera.distortion[0] = -0.08;
  const std::vector<OutlineTrack> outlines = outlines_of(cameras, walker, 3, 25.0, 0.0, 1);
  int pairs = 0;
  for (std::size_t a = 0; a < cameras.size(); ++a)
    for (std::size_t b = a + 1; b < cameras.size(); ++b) {
      const FrontierFinder finder(cameras[a], cameras[b]);
      const EpipolarPair pair(cameras[a], cameras[b]);
      for (const int side : {0, 1}) {
        const auto in_a = finder.find(0, outlines[a], 1.0, side), in_b = finder.find(1, outlines[b], 1.0, side);
        if (!in_a || !in_b) continue;
        ++pairs;
        EXPECT_LT(std::abs(pair.distance(*straight_pixel(cameras[a], *in_a), *straight_pixel(cameras[b], *in_b))), 0.2);
      }
    }
  EXPECT_GE(pairs, 20);
}

TEST(OutlineTracks, TangentsBetweenFramesMoveEvenly) {
  const std::vector<Camera> cameras = rig_of(3, 800);
  const std::vector<OutlineTrack> outlines = outlines_of(cameras, walker, 2, 25.0, 0.0, 1);
  const FrontierFinder finder(cameras[0], cameras[1]);
  const auto before = finder.find(0, outlines[0], 0.0, 1), after = finder.find(0, outlines[0], 1.0, 1);
  const auto between = finder.find(0, outlines[0], 0.25, 1);
  ASSERT_TRUE(before && after && between);
  EXPECT_LT((*between - (0.75 * *before + 0.25 * *after)).norm(), 1e-9);
  EXPECT_FALSE(finder.find(0, outlines[0], 1.25, 1));
  EXPECT_FALSE(finder.find(0, outlines[0], -0.5, 1));
}

/// A detector whose errors last: each point of each camera is always off by the same few pixels.
PointTracks biased(PointTracks tracks, double pixels) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, pixels);
  for (CameraTrack& track : tracks.cameras)
    for (int k = 0; k < track.num_points(); ++k) {
      const Vector2d off(normal(random), normal(random));
      for (long f = 0; f < track.num_frames(); ++f) track.at(f, k).pixel += off;
    }
  return tracks;
}

TEST(OutlineTracks, OutlinesMendWhatBiasedPointsCannot) {
  const std::vector<Camera> ground_truth = rig_of(6, 1000), start = support::disturbed(ground_truth, 2.0, 0.05, 3);
  support::FilmOptions film;
  film.frames = 150;
  const PointTracks points = biased(support::film(ground_truth, walker, film), 4.0);
  const support::RigError by_points = support::error_of(refine_rig(start, points).cameras, ground_truth);
  const RigRefinement found = refine_rig(start, {{points, outlines_of(ground_truth, walker, 150, 25.0, 0.2, 1)}});
  const support::RigError error = support::error_of(found.cameras, ground_truth);
  EXPECT_GT(by_points.metres, 2.0 * error.metres);
  EXPECT_LT(error.degrees, 0.1);
  EXPECT_LT(error.metres, 0.003);
  for (const CameraRefinement& report : found.reports) EXPECT_GT(report.tangents, 500);
}

TEST(OutlineTracks, OutlinesSharpenOffsets) {
  const std::vector<Camera> cameras = rig_of(5, 800);
  support::FilmOptions film;
  film.frames = 70;
  film.noise = 5.0;
  film.offset = {0.0, 3.3, -2.7, 1.4, -4.5};
  const PointTracks points = support::film(cameras, walker, film);
  const Synchronisation found =
      synchronise(cameras, points, {}, outlines_of(cameras, walker, 70, 25.0, 0.2, 1, film.offset));
  const Synchronisation by_points = synchronise(cameras, points);
  double error = 0.0, error_of_points = 0.0;
  for (std::size_t c = 1; c < cameras.size(); ++c) {
    EXPECT_TRUE(found.cameras[c].known) << found.cameras[c].reason;
    EXPECT_NEAR(found.cameras[c].offset, film.offset[c], 0.03) << c;
    error += std::abs(found.cameras[c].offset - film.offset[c]);
    error_of_points += std::abs(by_points.cameras[c].offset - film.offset[c]);
  }
  EXPECT_LT(error, 0.5 * error_of_points);
}

}  // namespace
}  // namespace doppel
