#include "doppel/calibration/estimation/world_by_person.h"

#include <gmock/gmock.h>

#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/estimation/stature.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel {
namespace {

using support::body_at;
using support::film;
using support::FilmOptions;
using support::rig_of;
using support::walker;
using ::testing::HasSubstr;

/// The walker's points of walking_rig.h: arms from 3, legs from 9.
const BodyPointIndices kWalker{{3, 6}, {9, 12}, {10, 13}, {11, 14}, {-1, -1}, {-1, -1}};
const double kWalkersStature = stature_by(0.85, 0.49);

/// The rig as a program that knows no metre and no floor would give it.
std::vector<Camera> elsewhere(const std::vector<Camera>& cameras, double scale, const Eigen::Vector3d& turn) {
  Similarity world;
  world.scale = scale;
  world.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  world.shift = Eigen::Vector3d(3.0, -2.0, 0.5);
  std::vector<Camera> moved;
  for (const Camera& camera : cameras) moved.push_back(transformed(camera, world));
  return moved;
}

/// Degrees between the true up and the one found, and the largest error of a camera's height over the floor, metres.
std::pair<double, double> errors(const std::vector<Camera>& ground_truth, const std::vector<Camera>& given,
                                 const WorldByPerson& found) {
  double degrees = 0.0, height = 0.0;
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    const Camera camera = transformed(given[c], found.world);
    const Eigen::Vector3d up = ground_truth[c].R.transpose() * (camera.R * Eigen::Vector3d::UnitY());
    degrees = std::max(degrees, std::acos(std::min(1.0, up.y())) * 180.0 / M_PI);
    height = std::max(height, std::abs(camera.centre().y() - ground_truth[c].centre().y()));
  }
  return {degrees, height};
}

TEST(WorldByPerson, FindsFloorUpAndMetresOfAWorldWithoutThem) {
  const std::vector<Camera> ground_truth = rig_of(5, 800);
  FilmOptions options;
  options.frames = 200;
  const PointTracks seen = film(ground_truth, walker, options);
  for (const double scale : {0.01, 0.7, 400.0}) {
    const std::vector<Camera> given = elsewhere(ground_truth, scale, {1.2, 0.4, -2.0});
    WorldOptions metres;
    metres.stature = kWalkersStature;
    const WorldByPerson found = world_by_person(given, seen, kWalker, metres);
    const auto [degrees, height] = errors(ground_truth, given, found);
    EXPECT_TRUE(found.scaled);
    EXPECT_NEAR(found.world.scale * scale, 1.0, 0.02);
    EXPECT_LT(degrees, 1.5);
    EXPECT_LT(height, 0.06);
    EXPECT_LT(found.floor_spread, 0.05);
  }
}

TEST(WorldByPerson, KeepsTheScaleOfAMetricWorld) {
  const std::vector<Camera> ground_truth = rig_of(4, 800), given = elsewhere(ground_truth, 1.0, {0.3, 0.0, 0.2});
  const WorldByPerson found = world_by_person(given, film(ground_truth, walker, {}), kWalker);
  EXPECT_FALSE(found.scaled);
  EXPECT_EQ(found.world.scale, 1.0);
  EXPECT_NEAR(found.stature, kWalkersStature, 0.05);
  EXPECT_NEAR(found.turn, std::acos(std::cos(0.36)), 0.03);
  EXPECT_LT(errors(ground_truth, given, found).first, 1.5);
  const WorldByPerson usual =
      world_by_person(elsewhere(ground_truth, 0.1, {0.3, 0.0, 0.2}), film(ground_truth, walker, {}), kWalker);
  EXPECT_TRUE(usual.scaled) << "nobody is 17 cm tall";
  EXPECT_NEAR(usual.stature, 1.7, 1e-12);
}

TEST(WorldByPerson, APersonOnOneSpotLeavesUpToTheUprightBody) {
  const std::vector<Camera> ground_truth = rig_of(4, 800);
  const auto on_spot = [](double t) { return body_at({0.0, 0.0, 0.0}, 0.4, 3.0 * t, 0.3); };
  const WorldByPerson found = world_by_person(ground_truth, film(ground_truth, on_spot, {}), kWalker);
  const auto [degrees, height] = errors(ground_truth, ground_truth, found);
  EXPECT_LT(degrees, 3.0);
  EXPECT_LT(height, 0.15);
}

TEST(WorldByPerson, StatureHardlyDependsOnTheHeightOfTheHips) {
  EXPECT_NEAR(stature_by(0.85, 0.49), stature_by(0.80, 0.54), 1e-12);
  EXPECT_NEAR(stature_by(0.0, 0.49), 1.75, 1e-12);
  EXPECT_NEAR(stature_by(0.85, 0.0), 0.85 / 0.475, 1e-12);
  EXPECT_EQ(stature_by(0.0, 0.0), 0.0);
}

TEST(WorldByPerson, SaysWhatIsMissing) {
  const std::vector<Camera> cameras = rig_of(3, 800);
  const PointTracks seen = film(cameras, walker, {});
  BodyPointIndices without = kWalker;
  without.ankles = {-1, 11};
  EXPECT_THAT(support::message_of<Error>([&] { world_by_person(cameras, seen, without); }), HasSubstr("ankles"));
  WorldOptions options;
  options.stature = -1.0;
  EXPECT_THAT(support::message_of<UsageError>([&] { world_by_person(cameras, seen, kWalker, options); }),
              HasSubstr("must be positive"));
  PointTracks empty = seen;
  for (CameraTrack& track : empty.cameras)
    for (long f = 0; f < track.num_frames(); ++f)
      for (int k = 9; k < 15; ++k) track.at(f, k) = {};
  EXPECT_THAT(support::message_of<Error>([&] { world_by_person(cameras, empty, kWalker); }),
              HasSubstr("finding the world"));
}

}  // namespace
}  // namespace doppel
