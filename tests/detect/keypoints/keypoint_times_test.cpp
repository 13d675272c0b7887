#include "doppel/detect/keypoints/keypoint_times.h"

#include <gtest/gtest.h>

#include <cmath>

namespace doppel::keypoint_times_test {
namespace {

/// One point that moves by (2, -1) in a frame, from (10, 20) in frame 0.
Keypoint moving(long frame, float confidence) {
  return {10.0f + 2.0f * static_cast<float>(frame), 20.0f - static_cast<float>(frame), confidence};
}

void expect_on_line(const Person& person, double time, float confidence) {
  ASSERT_EQ(person.size(), 1u);
  EXPECT_NEAR(person[0].x, 10.0 + 2.0 * time, 1e-5);
  EXPECT_NEAR(person[0].y, 20.0 - time, 1e-5);
  EXPECT_EQ(person[0].confidence, confidence);
}

TEST(KeypointTimes, LieOnALineBetweenFrames) {
  const std::map<long, Person> track{{0, {moving(0, 0.9f)}}, {1, {moving(1, 0.4f)}}, {2, {moving(2, 0.8f)}}};
  expect_on_line(person_at(track, 0.25), 0.25, 0.4f);
  expect_on_line(person_at(track, 1.75), 1.75, 0.4f);
  const std::vector<Person> all = interpolate_people(track, {0.5, 1.0});
  ASSERT_EQ(all.size(), 2u);
  expect_on_line(all[1], 1.0, 0.4f);
}

TEST(KeypointTimes, AreTheFrameItselfAtWholeNumbers) {
  const std::map<long, Person> track{{0, {moving(0, 0.9f)}}, {1, {Keypoint()}}, {2, {moving(2, 0.8f)}}};
  EXPECT_EQ(person_at(track, 1.0)[0].confidence, 0.0f);
  EXPECT_TRUE(person_at(track, 3.0).empty());
}

TEST(KeypointTimes, ReachOverOneMissingFrameOnEitherSide) {
  const std::map<long, Person> track{{0, {moving(0, 0.9f)}}, {1, {Keypoint()}}, {2, {moving(2, 0.8f)}}};
  expect_on_line(person_at(track, 0.5), 0.5, 0.8f);
  expect_on_line(person_at(track, 1.5), 1.5, 0.8f);
  const std::map<long, Person> four{{0, {moving(0, 0.9f)}}, {3, {moving(3, 0.7f)}}};
  expect_on_line(person_at(four, 1.5), 1.5, 0.7f);
  const std::map<long, Person> far{{0, {moving(0, 0.9f)}}, {4, {moving(4, 0.8f)}}};
  for (const double time : {0.5, 1.5, 2.5, 3.5}) {
    const Person person = person_at(far, time);
    for (const Keypoint& point : person) EXPECT_EQ(point.confidence, 0.0f) << time;
  }
}

TEST(KeypointTimes, OfTimesThatAreNone) {
  const std::map<long, Person> track{{0, {moving(0, 0.9f)}}};
  for (const double time : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e200}) EXPECT_TRUE(person_at(track, time).empty());
  EXPECT_TRUE(person_at({}, 0.5).empty());
  expect_on_line(person_at({{-1, {moving(-1, 0.5f)}}, {0, {moving(0, 0.5f)}}}, -0.5), -0.5, 0.5f);
}

}  // namespace
}  // namespace doppel::keypoint_times_test
