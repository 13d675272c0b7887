#include "doppel/calibration/estimation/refine_rig.h"

#include <gmock/gmock.h>

#include <limits>

#include "calibration/estimation/rig_error.h"
#include "calibration/estimation/walking_rig.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel {
namespace {

using support::disturbed;
using support::error_of;
using support::film;
using support::FilmOptions;
using support::rig_of;
using support::RigError;
using support::walker;
using ::testing::HasSubstr;

TEST(RefineRig, RecoversDisturbedCameras) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const int count = 2 * static_cast<int>(seed) + 2, size = seed == 1 ? 1000 : 512;
    const std::vector<Camera> ground_truth = rig_of(count, size), start = disturbed(ground_truth, 2.0, 0.05, seed);
    FilmOptions options;
    options.seed = seed;
    options.frames = 300;
    options.outliers = 0.01 * (2.0 * seed - 1.0);
    const RigRefinement found = refine_rig(start, film(ground_truth, walker, options));
    const RigError error = error_of(found.cameras, ground_truth);
    EXPECT_LT(error.degrees, 0.1) << "seed " << seed;
    EXPECT_LT(error.metres, 0.003) << "seed " << seed;
    EXPECT_LT(found.median_after, 0.4 * found.median_before);
    EXPECT_LT(found.median_after, 2.2);  // 1.18 * 1.5 px is the median length of the noise
    for (const CameraRefinement& report : found.reports) {
      EXPECT_TRUE(report.refined);
      EXPECT_GT(report.inliers, 0.85);
      EXPECT_GT(report.rotation_change, 0.2 * M_PI / 180.0);
    }
  }
}

TEST(RefineRig, OneCameraFarOff) {
  const std::vector<Camera> ground_truth = rig_of(5, 800);
  std::vector<Camera> start = ground_truth;
  start[2] = disturbed({ground_truth[2]}, 4.0, 0.15, 5)[0];
  FilmOptions options;
  options.frames = 250;
  RefineOptions refine;
  refine.fixed = {0, 1, 3, 4};
  const RigRefinement found = refine_rig(start, film(ground_truth, walker, options), refine);
  EXPECT_LT((found.cameras[2].centre() - ground_truth[2].centre()).norm(), 0.003);
  EXPECT_LT(Eigen::AngleAxisd(found.cameras[2].R * ground_truth[2].R.transpose()).angle(), 0.1 * M_PI / 180.0);
  for (const std::size_t c : {0U, 1U, 3U, 4U}) EXPECT_EQ(found.cameras[c].t, ground_truth[c].t);
}

TEST(RefineRig, RecoversFocalLengths) {
  const std::vector<Camera> ground_truth = rig_of(6, 1000);
  std::vector<Camera> start = disturbed(ground_truth, 1.0, 0.02, 9);
  for (std::size_t c = 0; c < start.size(); ++c) start[c].K.topLeftCorner<2, 2>() *= c % 2 ? 1.03 : 0.97;
  FilmOptions options;
  options.frames = 400;
  RefineOptions refine;
  refine.focal = true;
  refine.most_times = 400;
  const RigRefinement found = refine_rig(start, film(ground_truth, walker, options), refine);
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    EXPECT_NEAR(found.cameras[c].K(0, 0) / ground_truth[c].K(0, 0), 1.0, 0.003) << c;
    EXPECT_NEAR(found.cameras[c].K(1, 1) / ground_truth[c].K(1, 1), 1.0, 0.003) << c;
    EXPECT_LT(found.reports[c].focal_sigma, 0.003);
    EXPECT_GT(found.reports[c].focal_sigma, 0.0);
  }
  EXPECT_LT(error_of(found.cameras, ground_truth).degrees, 0.1);
}

TEST(RefineRig, LensesAndPrincipalPoints) {
  std::vector<Camera> ground_truth = rig_of(6, 1000);
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    if (c % 2) ground_truth[c].lens = Lens::fisheye;
    ground_truth[c].distortion[0] = -0.1;
    ground_truth[c].distortion[1] = 0.03;
  }
  std::vector<Camera> start = disturbed(ground_truth, 1.0, 0.02, 4);
  for (Camera& camera : start) camera.K(0, 2) += 8.0;
  FilmOptions options;
  options.frames = 300;
  RefineOptions refine;
  refine.principal_point = true;
  const RigRefinement found = refine_rig(start, film(ground_truth, walker, options), refine);
  // A shift of the principal point looks much like a turn of the camera: half of the 8 pixels remain at worst.
  for (std::size_t c = 0; c < ground_truth.size(); ++c)
    EXPECT_NEAR(found.cameras[c].K(0, 2), ground_truth[c].K(0, 2), 4.0) << c;
  EXPECT_LT(found.median_after, 2.2);
}

/// Sums over cameras and four recordings, square metres.
struct CentreErrors {
  double errors = 0.0, variances = 0.0;
};
/// @param degrees, metres errors of the cameras before the refinement
CentreErrors centre_errors(unsigned first_seed, FilmOptions options, double degrees, double metres) {
  const std::vector<Camera> ground_truth = rig_of(5, 800);
  CentreErrors sums;
  for (options.seed = first_seed; options.seed < first_seed + 4; ++options.seed) {
    const std::vector<Camera> start = disturbed(ground_truth, degrees, metres, options.seed);
    const RigRefinement found = refine_rig(start, film(ground_truth, walker, options));
    const std::vector<Camera> aligned = support::aligned(found.cameras, ground_truth);
    for (std::size_t c = 0; c < ground_truth.size(); ++c) {
      sums.errors += (aligned[c].centre() - ground_truth[c].centre()).squaredNorm();
      sums.variances += std::pow(found.reports[c].centre_sigma, 2);
    }
  }
  return sums;
}

TEST(RefineRig, SigmasAreAsLargeAsTheErrors) {
  const CentreErrors sums = centre_errors(30, {}, 1.0, 0.02);
  EXPECT_GT(sums.errors, 0.2 * sums.variances);
  EXPECT_LT(sums.errors, 4.0 * sums.variances);
}

TEST(RefineRig, SigmasOfAShortRecordingAreNotTooSmall) {
  FilmOptions options;
  options.frames = 12;
  const CentreErrors sums = centre_errors(40, options, 0.0, 0.0);
  EXPECT_LT(sums.errors, 4.0 * sums.variances);
}

TEST(RefineRig, LimbsOfConstantLengthHelpFewCameras) {
  const std::vector<Camera> ground_truth = rig_of(3, 512);
  FilmOptions options;
  options.frames = 120;
  options.noise = 3.0;
  const PointTracks tracks = film(ground_truth, walker, options);
  const std::vector<Camera> start = disturbed(ground_truth, 2.0, 0.05, 2);
  RefineOptions refine;
  const RigError without = error_of(refine_rig(start, tracks, refine).cameras, ground_truth);
  refine.limbs = {{3, 4}, {4, 5}, {6, 7}, {7, 8}, {9, 10}, {10, 11}, {12, 13}, {13, 14}};
  refine.limb_sigma = 0.01;
  const RigError with = error_of(refine_rig(start, tracks, refine).cameras, ground_truth);
  EXPECT_LT(with.metres, without.metres);
}

TEST(RefineRig, LeavesOutACameraWithoutPoints) {
  const std::vector<Camera> ground_truth = rig_of(5, 512);
  const std::vector<Camera> start = disturbed(ground_truth, 1.0, 0.02, 3);
  PointTracks tracks = film(ground_truth, walker, {});
  tracks.cameras[3] = CameraTrack(tracks.cameras[3].name, 25.0, 200, support::kWalkerPoints);
  const RigRefinement found = refine_rig(start, tracks);
  EXPECT_FALSE(found.reports[3].refined);
  EXPECT_THAT(found.reports[3].reason, HasSubstr("0 points"));
  EXPECT_EQ(found.cameras[3].R, start[3].R);
  EXPECT_TRUE(found.reports[2].refined);
}

TEST(RefineRig, RefusesWhenTheOnlyFreeCameraSawNothing) {
  const std::vector<Camera> cameras = rig_of(4, 512);
  PointTracks tracks = film(cameras, walker, {});
  tracks.cameras[3] = CameraTrack(tracks.cameras[3].name, 25.0, 200, support::kWalkerPoints);
  RefineOptions options;
  options.fixed = {0, 1, 2, 2};
  EXPECT_THAT(support::message_of<UsageError>([&] { refine_rig(cameras, tracks, options); }),
              HasSubstr("c3: it saw only 0 points"));
}

TEST(RefineRig, RefusesHostileInput) {
  using support::message_of;
  const std::vector<Camera> cameras = rig_of(3, 512);
  const PointTracks tracks = film(cameras, walker, {});
  PointTracks one = tracks;
  one.cameras.resize(1);
  EXPECT_THAT(message_of<Error>([&] { refine_rig({cameras[0]}, one); }), HasSubstr("at least 2 cameras"));
  PointTracks same = tracks;
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (long f = 0; f < 200; ++f)
      for (int k = 0; k < support::kWalkerPoints; ++k)
        same.cameras[c].at(f, k) = {cameras[c].project({0.1, 1.0, 0.0}), 1.0};
  EXPECT_THAT(message_of<Error>([&] { refine_rig(cameras, same); }), HasSubstr("one position"));
  PointTracks broken = tracks;
  for (CameraTrack& track : broken.cameras)
    for (long f = 0; f < 200; ++f)
      for (int k = 0; k < support::kWalkerPoints; ++k)
        track.at(f, k).pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(message_of<Error>([&] { refine_rig(cameras, broken); }), HasSubstr("only 0 points"));
  RefineOptions wrong;
  wrong.limbs = {{0, 99}};
  EXPECT_THAT(message_of<UsageError>([&] { refine_rig(cameras, tracks, wrong); }), HasSubstr("limb"));
  RefineOptions all_fixed;
  all_fixed.fixed = {0, 1, 2};
  EXPECT_THAT(message_of<UsageError>([&] { refine_rig(cameras, tracks, all_fixed); }), HasSubstr("all 3 cameras"));
  std::vector<Camera> faulty = cameras;
  faulty[1].K(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<Error>([&] { refine_rig(faulty, tracks); }), HasSubstr("not finite"));
  const std::vector<Camera> coinciding(3, cameras[0]);
  PointTracks of_one = tracks;
  for (std::size_t c = 0; c < 3; ++c) {
    of_one.cameras[c] = tracks.cameras[0];
  }
  EXPECT_THAT(message_of<Error>([&] { refine_rig(coinciding, of_one); }), HasSubstr("points"));
}

}  // namespace
}  // namespace doppel
