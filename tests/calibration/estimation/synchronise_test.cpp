#include "doppel/calibration/estimation/synchronise.h"

#include <gmock/gmock.h>

#include <limits>

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

constexpr double kTenthOfFrame = 0.1;

/// The largest error of the offsets relative to the reference, in frames; all must be known.
double worst_error(const Synchronisation& found, const FilmOptions& ground_truth) {
  double worst = 0.0;
  const double base = ground_truth.offset[0] / (ground_truth.fps.empty() ? 25.0 : ground_truth.fps[0]);
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const double fps = ground_truth.fps.empty() ? 25.0 : ground_truth.fps[c];
    EXPECT_TRUE(found.cameras[c].known) << found.cameras[c].name << ": " << found.cameras[c].reason;
    worst = std::max(worst, std::abs(found.cameras[c].offset - (ground_truth.offset[c] - base * fps)));
  }
  return worst;
}

TEST(Synchronise, FindsOffsetsToATenthOfAFrame) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const int count = 3 + static_cast<int>(seed);
    const std::vector<Camera> cameras = rig_of(count, 512);
    FilmOptions options;
    options.seed = seed;
    options.outliers = 0.05;
    for (int c = 0; c < count; ++c) options.offset.push_back(c == 0 ? 0.0 : (c % 2 ? 7.3 : -7.3) + 0.17 * c);
    const Synchronisation found = synchronise(cameras, film(cameras, walker, options));
    EXPECT_LT(worst_error(found, options), kTenthOfFrame) << "seed " << seed;
    for (const CameraTiming& timing : found.cameras) EXPECT_LE(timing.sigma, 0.1) << timing.name;
    EXPECT_LT(found.after, 0.6 * found.before);
  }
}

TEST(Synchronise, SaysHowSureItIs) {
  std::vector<double> errors_in_sigmas;
  for (unsigned seed = 10; seed < 16; ++seed) {
    const std::vector<Camera> cameras = rig_of(5, 800);
    FilmOptions options;
    options.seed = seed;
    options.offset = {0.0, 3.4, -2.6, 11.1, -7.9};
    const Synchronisation found = synchronise(cameras, film(cameras, walker, options));
    for (std::size_t c = 1; c < cameras.size(); ++c)
      errors_in_sigmas.push_back((found.cameras[c].offset - options.offset[c]) / found.cameras[c].sigma);
  }
  double squares = 0.0;
  for (const double error : errors_in_sigmas) squares += error * error;
  const double rms = std::sqrt(squares / static_cast<double>(errors_in_sigmas.size()));
  EXPECT_GT(rms, 0.15);
  EXPECT_LT(rms, 2.0);
}

TEST(Synchronise, BearsACalibrationThatIsTwoDegreesOff) {
  const std::vector<Camera> cameras = rig_of(6, 800);
  FilmOptions options;
  options.offset = {0.0, 7.3, -7.3, 12.6, -20.2, 3.5};
  const PointTracks tracks = film(cameras, walker, options);
  const Synchronisation found = synchronise(disturbed(cameras, 2.0, 0.05, 3), tracks);
  EXPECT_LT(worst_error(found, options), kTenthOfFrame);
}

TEST(Synchronise, ManyCamerasAndDifferentRates) {
  const std::vector<Camera> cameras = rig_of(12, 800);
  FilmOptions options;
  for (int c = 0; c < 12; ++c) {
    options.fps.push_back(c % 3 == 0 ? 25.0 : c % 3 == 1 ? 30.0 : 50.0);
    options.offset.push_back(c == 0 ? 0.0 : 5.0 * std::sin(4.0 * c) + 0.3);
  }
  const Synchronisation found = synchronise(cameras, film(cameras, walker, options));
  EXPECT_LT(worst_error(found, options), kTenthOfFrame);
}

TEST(Synchronise, FindsDrift) {
  const std::vector<Camera> cameras = rig_of(5, 800);
  FilmOptions options;
  options.frames = 500;
  options.fps = {25.0, 25.0, 25.02, 25.0, 24.985};
  options.offset = {0.0, 4.2, -6.1, 1.7, 2.5};
  PointTracks tracks = film(cameras, walker, options);
  for (CameraTrack& track : tracks.cameras) track.fps = 25.0;
  SynchroniseOptions search;
  search.drift = true;
  const Synchronisation found = synchronise(cameras, tracks, search);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    ASSERT_TRUE(found.cameras[c].known) << found.cameras[c].reason;
    for (const double seconds : {0.0, 10.0, 19.0})
      EXPECT_NEAR(found.cameras[c].offset + seconds * found.cameras[c].fps,
                  options.offset[c] + seconds * options.fps[c], kTenthOfFrame)
          << c << " at " << seconds;
  }
}

/// A body that does not move its limbs.
support::Person glider(double speed) {
  return [speed](double t) { return support::body_at({speed * (t - 4.0), 0.0, 0.2}, 0.4, 0.0, 0.0); };
}

TEST(Synchronise, IsLessSureOfAPersonWhoGlides) {
  const std::vector<Camera> cameras = rig_of(4, 800);
  FilmOptions options;
  options.offset = {0.0, 3.4, -2.6, 5.1};
  const Synchronisation walking = synchronise(cameras, film(cameras, walker, options));
  const Synchronisation gliding = synchronise(cameras, film(cameras, glider(0.2), options));
  for (std::size_t c = 1; c < cameras.size(); ++c) {
    EXPECT_GT(gliding.cameras[c].sigma, 2.0 * walking.cameras[c].sigma);
    if (!gliding.cameras[c].known) continue;
    EXPECT_NEAR(gliding.cameras[c].offset, options.offset[c], 3.0 * gliding.cameras[c].sigma);
  }
}

TEST(Synchronise, CannotTellWithoutMotion) {
  const std::vector<Camera> cameras = rig_of(4, 800);
  const support::Person still = [](double t) {
    return support::body_at({0.002 * std::sin(t), 0.0, 0.0}, 0.4, 0.3 * std::sin(1.3 * t), 0.02);
  };
  FilmOptions options;
  options.offset = {0.0, 3.4, -2.6, 5.1};
  const Synchronisation found = synchronise(cameras, film(cameras, still, options));
  for (std::size_t c = 1; c < cameras.size(); ++c) {
    EXPECT_FALSE(found.cameras[c].known);
    EXPECT_THAT(found.cameras[c].reason, HasSubstr("moves too little"));
    EXPECT_EQ(found.cameras[c].offset, 0.0);
  }
}

TEST(Synchronise, SaysThatTheWindowIsTooSmall) {
  const std::vector<Camera> cameras = rig_of(4, 800);
  FilmOptions options;
  options.offset = {0.0, 8.4, 0.0, 0.0};
  SynchroniseOptions search;
  search.window = 5.0;
  const Synchronisation found = synchronise(cameras, film(cameras, walker, options), search);
  EXPECT_FALSE(found.cameras[1].known);
}

TEST(Synchronise, RefusesHostileInput) {
  const std::vector<Camera> cameras = rig_of(3, 512);
  FilmOptions options;
  options.frames = 40;
  const PointTracks tracks = film(cameras, walker, options);
  using support::message_of;
  PointTracks one = tracks;
  one.cameras.resize(1);
  EXPECT_THAT(message_of<Error>([&] { synchronise({cameras[0]}, one); }), HasSubstr("at least 2 cameras"));
  EXPECT_THAT(message_of<Error>([&] { synchronise({cameras[0], cameras[1]}, tracks); }), HasSubstr("2 calibrated"));
  PointTracks empty = tracks;
  for (CameraTrack& track : empty.cameras) track = CameraTrack(track.name, track.fps, 40, support::kWalkerPoints);
  EXPECT_THAT(message_of<Error>([&] { synchronise(cameras, empty); }), HasSubstr("no camera saw any point"));
  PointTracks slow = tracks;
  slow.cameras[1].fps = 0.0;
  EXPECT_THAT(message_of<Error>([&] { synchronise(cameras, slow); }), HasSubstr("frames per second"));
  SynchroniseOptions wrong;
  wrong.reference = 7;
  EXPECT_THAT(message_of<UsageError>([&] { synchronise(cameras, tracks, wrong); }), HasSubstr("camera 7"));
}

TEST(Synchronise, SurvivesBadNumbersAndEqualPoints) {
  const std::vector<Camera> cameras = rig_of(4, 512);
  FilmOptions options;
  options.offset = {0.0, 3.4, -2.6, 5.1};
  PointTracks tracks = film(cameras, walker, options);
  for (long f = 0; f < 200; f += 7) tracks.cameras[1].at(f, 3).pixel.x() = std::numeric_limits<double>::quiet_NaN();
  tracks.cameras[2].at(5, 1).confidence = std::numeric_limits<double>::infinity();
  EXPECT_LT(worst_error(synchronise(cameras, tracks), options), kTenthOfFrame);
  for (CameraTrack& track : tracks.cameras)
    for (long f = 0; f < track.num_frames(); ++f)
      for (int k = 0; k < track.num_points(); ++k) track.at(f, k) = {{256.0, 256.0}, 1.0};
  for (const CameraTiming& timing : synchronise(cameras, tracks).cameras) {
    EXPECT_TRUE(std::isfinite(timing.offset));
    EXPECT_EQ(timing.offset, 0.0);
  }
}

}  // namespace
}  // namespace doppel
