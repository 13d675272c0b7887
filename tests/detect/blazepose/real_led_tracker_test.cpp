/// A tracker that is told where the person is, on an image of two people.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "doppel/detect/blazepose/body_detector.h"
#include "support/blazepose_weights.h"

namespace doppel::real_led_tracker_test {
namespace {

class RealLedTracker : public support::BlazePoseTest {
 protected:
  void SetUp() override {
    BlazePoseTest::SetUp();
    if (IsSkipped()) return;
    detector_.emplace(BodyDetectorOptions{.model = BlazePoseModel::lite, .masks = false});
    image_ = cv::imread((shared_ / "oracle/blazepose/pictures/realx_pair_a.png").string());
    const std::vector<BodyPose> people = detector_->detect_all(image_);
    ASSERT_EQ(people.size(), 2u);
    first_ = hips_of(people[0]);
    second_ = hips_of(people[1]);
    radius_ = 0.25 * (first_ - second_).norm();
  }
  void expect_at(const std::optional<BodyPose>& pose, const Eigen::Vector2d& hips) const {
    ASSERT_TRUE(pose);
    EXPECT_LT((hips_of(*pose) - hips).norm(), radius_);
  }
  std::optional<BodyDetector> detector_;
  cv::Mat image_;
  Eigen::Vector2d first_, second_;
  double radius_ = 0.0;
};

TEST_F(RealLedTracker, AnotherPersonIsReplacedInTheFrameOfTheAnchor) {
  BodyTracker tracker(*detector_, first_);
  expect_at(tracker.track(image_), first_);
  expect_at(tracker.track(image_, PersonAnchor{second_, radius_, true}), second_);
  expect_at(tracker.track(image_), second_);
}

TEST_F(RealLedTracker, TheRightPersonIsFollowedAsWithoutAnchors) {
  BodyTracker free(*detector_, first_), led(*detector_, first_);
  for (int frame = 0; frame < 3; ++frame) {
    const auto expected = free.track(image_), found = led.track(image_, PersonAnchor{first_, radius_, true});
    ASSERT_TRUE(expected && found);
    EXPECT_EQ(found->roi.centre, expected->roi.centre);
    EXPECT_EQ(hips_of(*found), hips_of(*expected));
  }
}

TEST_F(RealLedTracker, NobodyIsFollowedWhereThePersonIsNot) {
  BodyTracker tracker(*detector_, first_);
  expect_at(tracker.track(image_), first_);
  EXPECT_FALSE(tracker.track(image_, PersonAnchor{{0, 0}, 0, false})) << "known to be invisible";
  EXPECT_FALSE(tracker.track(image_, PersonAnchor{0.5 * (first_ + second_), radius_, true})) << "nobody is there";
  expect_at(tracker.track(image_, PersonAnchor{second_, radius_, true}), second_);
}

}  // namespace
}  // namespace doppel::real_led_tracker_test
