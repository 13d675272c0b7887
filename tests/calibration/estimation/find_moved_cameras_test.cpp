#include "doppel/calibration/estimation/find_moved_cameras.h"

#include <gmock/gmock.h>

#include "calibration/estimation/walking_rig.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel {
namespace {

using support::disturbed;
using support::film;
using support::FilmOptions;
using support::rig_of;
using support::walker;
using ::testing::HasSubstr;

/// What a rig films one of whose cameras is pushed at a frame.
PointTracks film_with_push(const std::vector<Camera>& cameras, int pushed, const Camera& after, long frame,
                           const FilmOptions& options) {
  PointTracks tracks = film(cameras, walker, options);
  std::vector<Camera> later = cameras;
  later[pushed] = after;
  const PointTracks from_then = film(later, walker, options);
  CameraTrack& track = tracks.cameras[pushed];
  for (long f = frame; f < track.num_frames(); ++f)
    for (int k = 0; k < track.num_points(); ++k) track.at(f, k) = from_then.cameras[pushed].at(f, k);
  return tracks;
}

TEST(FindMovedCameras, NamesCameraAndFrame) {
  for (const int count : {3, 6}) {
    const std::vector<Camera> cameras = rig_of(count, 800);
    FilmOptions options;
    options.frames = 400;
    const Camera after = disturbed({cameras[1]}, 1.0, 0.01, 4)[0];
    const auto found = find_moved_cameras(cameras, film_with_push(cameras, 1, after, 263, options));
    ASSERT_EQ(found.size(), 1U) << count;
    EXPECT_EQ(found[0].camera, 1);
    EXPECT_NEAR(found[0].frame, 262.5, 1.5);
    EXPECT_NEAR(found[0].rotation * 180.0 / M_PI, 1.0, 0.15);
    EXPECT_LT((found[0].after.centre() - after.centre()).norm(), 0.01);
    EXPECT_LT((found[0].before.centre() - cameras[1].centre()).norm(), 0.01);
  }
}

TEST(FindMovedCameras, TwoOfSix) {
  const std::vector<Camera> cameras = rig_of(6, 800);
  FilmOptions options;
  options.frames = 300;
  PointTracks tracks = film_with_push(cameras, 4, disturbed({cameras[4]}, 1.5, 0.0, 4)[0], 100, options);
  tracks.cameras[0] = film_with_push(cameras, 0, disturbed({cameras[0]}, 1.0, 0.02, 8)[0], 220, options).cameras[0];
  const auto found = find_moved_cameras(cameras, tracks);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].camera, 4);
  EXPECT_NEAR(found[0].frame, 99.5, 1.5);
  EXPECT_EQ(found[1].camera, 0);
  EXPECT_NEAR(found[1].frame, 219.5, 1.5);
}

TEST(FindMovedCameras, NamesNobodyWithoutAMove) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const std::vector<Camera> cameras = rig_of(5, 512);
    FilmOptions options;
    options.seed = seed;
    const PointTracks tracks = film(cameras, walker, options);
    EXPECT_TRUE(find_moved_cameras(cameras, tracks).empty());
    // A calibration that is wrong all the time is no move either.
    EXPECT_TRUE(find_moved_cameras(disturbed(cameras, 0.7, 0.02, seed), tracks).empty()) << seed;
  }
}

TEST(FindMovedCameras, NeedsThreeCameras) {
  const std::vector<Camera> cameras = rig_of(2, 512);
  const PointTracks tracks = film(cameras, walker, {});
  EXPECT_THAT(support::message_of<Error>([&] { find_moved_cameras(cameras, tracks); }), HasSubstr("at least 3"));
}

}  // namespace
}  // namespace doppel
