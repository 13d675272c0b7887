#include "doppel/detect/keypoints/keypoint_filter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace doppel::keypoint_filter_test {
namespace {

using Frames = std::vector<std::vector<Keypoint>>;

/// A landmark that swings, and one that stays.
Frames swinging(int count) {
  Frames frames;
  for (int f = 0; f < count; ++f)
    frames.push_back({{100.0f + 40.0f * std::sin(0.15f * static_cast<float>(f)), 3.0f * static_cast<float>(f), 0.8f},
                      {50.0f, 60.0f, 0.6f}});
  return frames;
}

KeypointFilter filter_of(int window, double sigma = 1.0) {
  KeypointFilter filter;
  filter.window = window;
  filter.sigma = sigma;
  return filter;
}

bool same(const Keypoint& a, const Keypoint& b) { return a.x == b.x && a.y == b.y && a.confidence == b.confidence; }

TEST(KeypointFiltering, IsOffByDefault) {
  Frames frames = swinging(20);
  frames[7][0] = {400, 400, 0.5f};
  frames[9][1] = {};
  const Frames raw = frames;
  filter_keypoints(frames, {}, {}, 512);
  for (std::size_t f = 0; f < frames.size(); ++f)
    for (int m = 0; m < 2; ++m) EXPECT_TRUE(same(frames[f][m], raw[f][m]));
}

TEST(KeypointFiltering, DropsWhatLiesFarFromItsNeighbours) {
  Frames frames = swinging(40);
  const Frames ground_truth = frames;
  frames[12][0].x += 60;
  frames[30][1].y -= 45;
  filter_keypoints(frames, {}, filter_of(3, 0.0), 512);
  // Bridged: near the ground truth again, and half as sure.
  EXPECT_NEAR(frames[12][0].x, ground_truth[12][0].x, 1.0);
  EXPECT_FLOAT_EQ(frames[12][0].confidence, 0.4f);
  EXPECT_FLOAT_EQ(frames[30][1].y, 60.0f);
  EXPECT_FLOAT_EQ(frames[30][1].confidence, 0.3f);
  for (int f = 0; f < 40; ++f) EXPECT_TRUE(f == 12 || same(frames[f][0], ground_truth[f][0])) << f;
}

TEST(KeypointFiltering, BridgesShortGapsOnly) {
  Frames frames = swinging(40);
  const auto hide = [&](int first, int last) {
    for (int f = first; f <= last; ++f) frames[f][1] = {};
  };
  hide(0, 1);    // at the beginning: nothing before it
  hide(10, 12);  // as long as the window
  hide(20, 23);  // longer
  hide(38, 39);
  filter_keypoints(frames, {}, filter_of(3), 512);
  for (const int f : {0, 1, 20, 21, 22, 23, 38, 39}) EXPECT_EQ(frames[f][1].confidence, 0.0f) << f;
  for (const int f : {10, 11, 12}) {
    EXPECT_FLOAT_EQ(frames[f][1].confidence, 0.3f) << f;
    EXPECT_NEAR(frames[f][1].x, 50.0f, 1e-4);
  }
}

TEST(KeypointFiltering, NeverReachesOverACut) {
  Frames frames(20, {{10, 10, 1}});
  for (int f = 10; f < 20; ++f) frames[f][0] = {30, 10, 1};
  Frames gap = frames;
  gap[9][0] = gap[10][0] = {};
  filter_keypoints(frames, {10}, filter_of(4, 2.0), 1e6);
  EXPECT_FLOAT_EQ(frames[9][0].x, 10.0f);
  EXPECT_FLOAT_EQ(frames[10][0].x, 30.0f);
  filter_keypoints(gap, {10}, filter_of(4, 2.0), 1e6);
  EXPECT_EQ(gap[9][0].confidence, 0.0f);
  EXPECT_EQ(gap[10][0].confidence, 0.0f);
}

TEST(KeypointFiltering, SmoothsNoiseByConfidence) {
  const auto noise = [](int f) { return 3.0f * std::sin(12.9898f * static_cast<float>(f * f)); };
  Frames frames = swinging(60);
  const Frames ground_truth = frames;
  for (int f = 0; f < 60; ++f) frames[f][0].x += noise(f);
  double before = 0.0, after = 0.0;
  for (int f = 0; f < 60; ++f) before += std::pow(frames[f][0].x - ground_truth[f][0].x, 2);
  filter_keypoints(frames, {}, filter_of(3), 512);
  for (int f = 0; f < 60; ++f) after += std::pow(frames[f][0].x - ground_truth[f][0].x, 2);
  EXPECT_LT(after, 0.6 * before);
  // An unsure neighbour hardly pulls.
  Frames pulled(5, {{10, 0, 1}});
  pulled[3][0] = {14, 0, 0.01f};
  filter_keypoints(pulled, {}, filter_of(2), 1e6);
  EXPECT_NEAR(pulled[2][0].x, 10.0, 0.05);
}

TEST(KeypointFiltering, NothingSeenStaysNothing) {
  Frames frames(6, std::vector<Keypoint>(2));
  filter_keypoints(frames, {3}, filter_of(2), 512);
  for (const auto& landmarks : frames)
    for (const Keypoint& point : landmarks) EXPECT_TRUE(same(point, {}));
  Frames none;
  filter_keypoints(none, {}, filter_of(2), 512);
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace doppel::keypoint_filter_test
