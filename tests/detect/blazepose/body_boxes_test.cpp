#include "doppel/detect/blazepose/body_boxes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "doppel/detect/blazepose/roi.h"

namespace doppel::body_boxes_test {
namespace {

using Eigen::Vector2d;

TEST(DetectorAnchors, LieAtTheCentresOfThreeGrids) {
  const std::vector<Vector2d> anchors = detector_anchors();
  ASSERT_EQ(anchors.size(), 2254u);
  EXPECT_EQ(anchors[0], Vector2d(0.5 / 28, 0.5 / 28));
  EXPECT_EQ(anchors[1], anchors[0]) << "two anchors in each cell";
  EXPECT_EQ(anchors[2], Vector2d(1.5 / 28, 0.5 / 28)) << "row by row";
  EXPECT_EQ(anchors[1568], Vector2d(0.5 / 14, 0.5 / 14));
  EXPECT_EQ(anchors[1568 + 392], Vector2d(0.5 / 7, 0.5 / 7));
  EXPECT_EQ(anchors[2253], Vector2d(6.5 / 7, 6.5 / 7));
  EXPECT_EQ(anchors[2248], anchors[2253]) << "six anchors in each cell";
}

struct DetectorOutputs {
  std::vector<float> values = std::vector<float>(std::size_t(kDetectorAnchors) * kDetectorValues, 0.0f);
  std::vector<float> scores = std::vector<float>(std::size_t(kDetectorAnchors), -20.0f);
};

TEST(DecodeBoxes, AddsTheAnchorToCentreAndKeypoints) {
  DetectorOutputs outputs;
  const std::size_t anchor = 1568 + 2 * (3 * 14 + 5);  // row 3, column 5 of the second grid
  const float values[] = {22.4f, -11.2f, 44.8f, 67.2f, 2.24f, 4.48f, 0, 0, -2.24f, 0, 0, 112};
  std::copy(std::begin(values), std::end(values), outputs.values.begin() + std::ptrdiff_t(anchor * 12));
  outputs.scores[anchor] = 2;
  outputs.scores[7] = -1e-3f;  // just below one half
  const std::vector<BodyBox> boxes = decode_boxes(outputs.values, outputs.scores);
  ASSERT_EQ(boxes.size(), 1u);
  const Vector2d centre(5.5 / 14, 3.5 / 14);
  EXPECT_NEAR(boxes[0].score, 1 / (1 + std::exp(-2.0)), 1e-12);
  EXPECT_LT((boxes[0].size - Vector2d(0.2, 0.3)).norm(), 1e-7);
  EXPECT_LT((boxes[0].corner - (centre + Vector2d(0.1 - 0.1, -0.05 - 0.15))).norm(), 1e-7);
  EXPECT_LT((boxes[0].keypoints[0] - (centre + Vector2d(0.01, 0.02))).norm(), 1e-7);
  EXPECT_LT((boxes[0].keypoints[3] - (centre + Vector2d(0, 0.5))).norm(), 1e-7);
}

TEST(DecodeBoxes, DropsBoxesThatAreNotFinite) {
  DetectorOutputs outputs;
  outputs.scores[0] = outputs.scores[2] = 500;
  outputs.scores[1] = std::numeric_limits<float>::quiet_NaN();
  outputs.values[2 * 12 + 5] = std::numeric_limits<float>::infinity();
  const std::vector<BodyBox> boxes = decode_boxes(outputs.values, outputs.scores);
  ASSERT_EQ(boxes.size(), 1u);
  EXPECT_EQ(boxes[0].score, 1.0);
}

BodyBox box_at(double x, double score) {
  BodyBox box;
  box.corner = {x, 0};
  box.size = {1, 1};
  box.score = score;
  for (Vector2d& point : box.keypoints) point = {x, x};
  return box;
}

TEST(MergeBoxes, AveragesOverlappingBoxesWeightedByScore) {
  // The overlap of unit squares that are d apart is (1 - d) / (1 + d): above 0.3 for d < 7/13.
  const std::vector<BodyBox> people = merge_boxes({box_at(0.5, 0.6), box_at(0.9, 0.7), box_at(0.0, 0.9)});
  ASSERT_EQ(people.size(), 2u);
  EXPECT_EQ(people[0].score, 0.9) << "the best one's";
  EXPECT_NEAR(people[0].corner.x(), (0.9 * 0.0 + 0.6 * 0.5) / 1.5, 1e-12);
  EXPECT_NEAR(people[0].keypoints[2].y(), (0.9 * 0.0 + 0.6 * 0.5) / 1.5, 1e-12);
  EXPECT_EQ(people[0].size, Vector2d(1, 1));
  EXPECT_EQ(people[1].corner.x(), 0.9);
  EXPECT_EQ(people[1].score, 0.7);
}

TEST(MergeBoxes, EndsForEmptyAndDegenerateBoxes) {
  EXPECT_TRUE(merge_boxes({}).empty());
  BodyBox point = box_at(0, 0.5);
  point.size.setZero();
  EXPECT_EQ(merge_boxes({point, point}).size(), 2u) << "boxes without area overlap nothing, not even themselves";
}

TEST(BoxInImage, UndoesTheLetterbox) {
  BodyBox box = box_at(0.25, 1);
  box.size = {0.5, 0.25};
  // 100 x 200: the letterbox is 200 pixels wide and starts at x = -50.
  const BodyBox result = box_in_image(box, {100, 200});
  EXPECT_EQ(result.corner, Vector2d(0, 0));
  EXPECT_EQ(result.size, Vector2d(100, 50));
  EXPECT_EQ(result.keypoints[1], Vector2d(0, 50));
}

TEST(BodyRoi, AnUprightPersonIsNotTurned) {
  const BodyRoi roi = body_roi({100, 200}, {100, 120});
  EXPECT_EQ(roi.centre, Vector2d(100, 200));
  EXPECT_DOUBLE_EQ(roi.side, 200);
  EXPECT_NEAR(roi.rotation, 0, 1e-15);
  EXPECT_LT((roi.image_from_roi({0, 0}) - Vector2d(0, 100)).norm(), 1e-9);
  EXPECT_LT((roi.image_from_roi({1, 0.5}) - Vector2d(200, 200)).norm(), 1e-9);
}

TEST(BodyRoi, TheUpperSideFacesTheRim) {
  for (const double angle : {0.3, 1.7, 3.1, -3.1, -1.5}) {
    const Vector2d rim = Vector2d(10, 20) + 8 * Vector2d(std::sin(angle), -std::cos(angle));
    const BodyRoi roi = body_roi({10, 20}, rim);
    EXPECT_NEAR(roi.rotation, angle, 1e-12);
    EXPECT_LT((roi.roi_from_image(rim) - Vector2d(0.5, 0.5 - 1 / 2.5)).norm(), 1e-12);
    EXPECT_LT((roi.image_from_roi(roi.roi_from_image({3, 4})) - Vector2d(3, 4)).norm(), 1e-9);
  }
}

TEST(BodyRoi, KnowsWhetherItCanBeUsed) {
  EXPECT_TRUE(body_roi({1, 2}, {3, 4}).valid());
  EXPECT_FALSE(body_roi({1, 2}, {1, 2}).valid()) << "no size";
  EXPECT_FALSE(body_roi({1, 2}, {1e9, 2}).valid());
  EXPECT_FALSE(body_roi({1, 2}, {std::nan(""), 2}).valid());
}

}  // namespace
}  // namespace doppel::body_boxes_test
