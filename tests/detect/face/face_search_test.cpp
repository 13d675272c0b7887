#include "doppel/detect/face/face_search.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "doppel/detect/face/face_roi.h"

namespace doppel::face_search_test {
namespace {

const cv::Mat kImage(4, 4, CV_8UC3, cv::Scalar::all(0));

/// A body whose nose is ahead of the ears, or behind them.
BodyPose body_that_looks(bool away) {
  BodyPose body{};
  body.world.fill(Eigen::Vector3d::Zero());
  body.world[0].z() = away ? 0.1 : -0.1;
  body.landmarks[2] = {110, 50, 0, 1, 1};
  body.landmarks[5] = {90, 50, 0, 1, 1};
  body.landmarks[9] = {106, 70, 0, 1, 1};
  body.landmarks[10] = {94, 70, 0, 1, 1};
  body.landmarks[0].visibility = 0.25;
  return body;
}

/// A face whose points lie in a box at the centre of its region.
FacePose face_in(const BodyRoi& roi, double score) {
  FacePose face;
  for (std::size_t i = 0; i < face.points.size(); ++i)
    face.points[i] << roi.centre + Eigen::Vector2d(i % 2 == 0 ? 10 : -10, i % 3 == 0 ? 5 : -5), 0;
  face.roi = roi;
  face.score = score;
  return face;
}

/// Reads regions one after the other, and finds a face in each as told.
struct Reader {
  std::vector<bool> finds;
  std::vector<BodyRoi> seen{};

  std::optional<FacePose> operator()(const cv::Mat& image, const BodyRoi& roi) {
    EXPECT_EQ(image.data, kImage.data);
    seen.push_back(roi);
    if (!finds.at(seen.size() - 1)) return std::nullopt;
    return face_in(roi, seen.size() == 1 ? 0.6 : 0.9);
  }
};

TEST(FindFace, ReadsTheRegionOfTheBodyAndThenThatOfThePoints) {
  Reader reader{{true, true}};
  const BodyPose body = body_that_looks(false);
  const auto face = find_face(std::ref(reader), kImage, body);
  ASSERT_TRUE(face);
  ASSERT_EQ(reader.seen.size(), 2u);
  EXPECT_EQ(reader.seen[0].centre, face_roi(body)->centre);
  const BodyRoi again = face_roi(face_in(reader.seen[0], 0.6));
  EXPECT_EQ(reader.seen[1].side, again.side);
  EXPECT_EQ(face->roi.side, again.side);
  EXPECT_EQ(face->score, 0.9);
}

TEST(FindFace, KeepsTheFirstReadingWhereTheSecondFindsNothing) {
  Reader reader{{true, false}};
  const auto face = find_face(std::ref(reader), kImage, body_that_looks(false));
  ASSERT_TRUE(face);
  EXPECT_EQ(face->score, 0.6);
}

TEST(FindFace, FindsNothingWhereTheRegionShowsNone) {
  Reader reader{{false}};
  EXPECT_FALSE(find_face(std::ref(reader), kImage, body_that_looks(false)));
}

TEST(FindFace, DoesNotReadAFaceThatLooksAway) {
  Reader reader{{}};
  EXPECT_FALSE(find_face(std::ref(reader), kImage, body_that_looks(true)));
  EXPECT_TRUE(reader.seen.empty());
}

TEST(FaceConfidence, IsTheProbabilityTimesTheVisibilityOfTheNose) {
  EXPECT_DOUBLE_EQ(face_confidence(face_in({}, 0.5), body_that_looks(false)), 0.5 * 0.25);
}

}  // namespace
}  // namespace doppel::face_search_test
