#include "doppel/io/figure_export/euler_tracks.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "support/test_character.h"

namespace doppel::euler_tracks_test {
namespace {

using Eigen::AngleAxisd, Eigen::Quaterniond, Eigen::Vector3d;

/// Angles as rotations about the axes of the world, x first.
Quaterniond turned(const Vector3d& degrees) {
  const Vector3d a = degrees * (M_PI / 180);
  return AngleAxisd(a.z(), Vector3d::UnitZ()) * AngleAxisd(a.y(), Vector3d::UnitY()) *
         AngleAxisd(a.x(), Vector3d::UnitX());
}

/// One node at rest in the origin, turned by `rest`.
Figure one_node(const Quaterniond& rest) {
  Figure figure;
  figure.nodes.push_back({"only", -1, 0});
  figure.rest.emplace_back(rest);
  return figure;
}

/// @param keys of the track; without any, all frames
FigureTracks tracks_of(const std::vector<Quaterniond>& rotation, std::vector<int> keys = {}) {
  FigureTracks tracks;
  tracks.rotation = {rotation};
  if (keys.empty()) {
    keys.resize(rotation.size());
    std::iota(keys.begin(), keys.end(), 0);
  }
  tracks.rotation_keys = {keys};
  return tracks;
}

TEST(EulerTracks, AFullTurnIsNoJump) {
  std::vector<Quaterniond> rotation;
  for (int t = 0; t < 60; ++t) rotation.push_back(turned({0, 20.0 * t, 0}));
  const EulerTrack track = euler_tracks(one_node(Quaterniond::Identity()), tracks_of(rotation), 1e-4)[0];
  ASSERT_EQ(track.frames.size(), 60U);
  for (std::size_t k = 1; k < track.frames.size(); ++k)
    EXPECT_LT((track.degrees[k] - track.degrees[k - 1]).norm(), 30.0) << k;
  EXPECT_LT((track.degrees.back() - Vector3d(0, 20.0 * 59, 0)).norm(), 1e-6);
}

TEST(EulerTracks, AnglesAreRelativeToTheRestPose) {
  const Quaterniond rest = turned({30, -70, 110});
  const std::vector<Quaterniond> rotation{rest, rest * turned({10, 20, 30})};
  const EulerTrack track = euler_tracks(one_node(rest), tracks_of(rotation), 1.0)[0];
  ASSERT_EQ(track.frames.size(), 2U);
  EXPECT_LT(track.degrees[0].norm(), 1e-9);
  EXPECT_LT((track.degrees[1] - Vector3d(10, 20, 30)).norm(), 1e-9);
}

TEST(EulerTracks, KeysAreAddedUntilLinesBetweenAnglesSuffice) {
  // Between two keys, the shortest way from one rotation to the other is no straight line of Euler angles.
  const Quaterniond from = turned({0, 0, 0}), to = turned({70, 60, 80});
  std::vector<Quaterniond> rotation;
  for (int t = 0; t <= 40; ++t) rotation.push_back(from.slerp(t / 40.0, to));
  const Figure figure = one_node(Quaterniond::Identity());
  const FigureTracks tracks = tracks_of(rotation, {0, 40});
  for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
    const auto turns = euler_tracks(figure, tracks, tolerance);
    EXPECT_GT(turns[0].frames.size(), 2U);
    EXPECT_LE(turns[0].frames.size(), 41U);
    const FigureTracks shown = with_euler_rotations(figure, tracks, turns);
    for (std::size_t t = 0; t < rotation.size(); ++t)
      EXPECT_LE(shown.rotation[0][t].angularDistance(rotation[t]), tolerance + 1e-12);
  }
  const auto rough = euler_tracks(figure, tracks, 1e-2), fine = euler_tracks(figure, tracks, 1e-4);
  EXPECT_LT(rough[0].frames.size(), fine[0].frames.size());
}

TEST(EulerTracks, QuaternionsMadeOfTheKeysSufficeToo) {
  // A turn about one axis is a line of Euler angles, but not of quaternions, which Blender makes of the keys.
  std::vector<Quaterniond> rotation;
  for (int t = 0; t <= 30; ++t) rotation.push_back(turned({0, 0, 5.0 * t}));
  const EulerTrack track = euler_tracks(one_node(Quaterniond::Identity()), tracks_of(rotation, {0, 30}), 1e-3)[0];
  for (std::size_t k = 1; k < track.frames.size(); ++k) {
    const Quaterniond a = turned(track.degrees[k - 1]), b = turned(track.degrees[k]);
    for (double t = track.frames[k - 1]; t <= track.frames[k]; t += 1.0) {
      const double share = (t - track.frames[k - 1]) / (track.frames[k] - track.frames[k - 1]);
      Quaterniond mixed((1 - share) * a.coeffs() + share * (a.dot(b) < 0 ? -1 : 1) * b.coeffs());
      EXPECT_LE(mixed.normalized().angularDistance(rotation[static_cast<std::size_t>(t)]), 1e-3 + 1e-9);
    }
  }
}

TEST(EulerTracks, NearThePoleKeysLieBetweenFrames) {
  // The x axis passes the pole of the angles (y = 90 degrees) at half a degree, between two frames.
  std::vector<Quaterniond> rotation;
  for (int t = 0; t <= 20; ++t) rotation.push_back(turned({0.5, 0, 0}) * turned({0, 71.0 + 2.0 * t, 0}));
  const EulerTrack track = euler_tracks(one_node(Quaterniond::Identity()), tracks_of(rotation), 1e-4)[0];
  EXPECT_TRUE(
      std::any_of(track.frames.begin(), track.frames.end(), [](double frame) { return frame != std::floor(frame); }));
  EXPECT_TRUE(std::is_sorted(track.frames.begin(), track.frames.end()));
  double worst = 0.0;
  for (double t = 0.0; t < 20.0; t += 1.0 / 256) {
    const auto frame = static_cast<std::size_t>(t);
    const Quaterniond wanted = rotation[frame].slerp(t - static_cast<double>(frame), rotation[frame + 1]);
    worst = std::max(worst, wanted.angularDistance(turned(track.at(t))));
  }
  EXPECT_LT(worst, 0.3 * 2.0 * M_PI / 180);  // a part of what the node turns from frame to frame
}

TEST(EulerTracks, ExactlyAtThePoleAnglesStayFinite) {
  for (const double side : {90.0, -90.0}) {
    std::vector<Quaterniond> rotation;
    for (int t = 0; t <= 10; ++t) rotation.push_back(turned({3.0 * t, side, 0}));
    const EulerTrack track = euler_tracks(one_node(Quaterniond::Identity()), tracks_of(rotation), 1e-4)[0];
    for (std::size_t t = 0; t < rotation.size(); ++t)
      EXPECT_LT(turned(track.at(static_cast<double>(t))).angularDistance(rotation[t]), 1.1e-4);
  }
}

TEST(EulerTracks, RandomMotionsKeepTheirKeysAndTheTolerance) {
  test_character::Noise noise(3);
  std::vector<Quaterniond> rotation{Quaterniond::Identity()};
  for (int t = 1; t < 400; ++t) {
    const Vector3d step = 8.0 * Vector3d(noise.next(), noise.next(), noise.next());
    rotation.push_back((rotation.back() * turned(step)).normalized());
  }
  const Figure figure = one_node(turned({10, 20, 30}));
  const FigureTracks tracks = tracks_of(rotation);
  const auto turns = euler_tracks(figure, tracks, 1e-4);
  EXPECT_LT(turns[0].frames.size(), 600U);
  for (const int key : tracks.rotation_keys[0])
    EXPECT_TRUE(std::binary_search(turns[0].frames.begin(), turns[0].frames.end(), static_cast<double>(key)));
  const FigureTracks shown = with_euler_rotations(figure, tracks, turns);
  for (std::size_t t = 0; t < rotation.size(); ++t)
    EXPECT_LT(shown.rotation[0][t].angularDistance(rotation[t]), 1e-6) << t;
}

TEST(EulerTracks, ANodeThatStandsStillHasOneKey) {
  const std::vector<Quaterniond> rotation(50, turned({1, 2, 3}));
  const EulerTrack track = euler_tracks(one_node(Quaterniond::Identity()), tracks_of(rotation, {0}), 1e-4)[0];
  EXPECT_THAT(track.frames, ::testing::ElementsAre(0.0));
  EXPECT_LT((track.at(30.5) - Vector3d(1, 2, 3)).norm(), 1e-9);
}

}  // namespace
}  // namespace doppel::euler_tracks_test
