#include "doppel/rigging/autorig/pose_sheet.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "rigging/plain_body.h"
#include "rigging/tubes.h"

namespace doppel::pose_sheet_test {
namespace {

constexpr int kRows = 6, kColumns = 4, kHeight = 100;

class PoseSheet : public ::testing::Test {
 protected:
  /// The pixels of an image of the sheet that do not show the wall, apart from the corner with the label.
  cv::Rect body_in(int row, int column) const {
    cv::Mat image = sheet_(cv::Rect(column * width_, row * kHeight, width_, kHeight)).clone();
    if (column == 0) image(cv::Rect(0, 0, width_, kHeight / 12)) = cv::Scalar(195, 190, 190);
    cv::Mat wall;
    cv::inRange(image, cv::Scalar(195, 190, 190), cv::Scalar(195, 190, 190), wall);
    return cv::boundingRect(255 - wall);
  }
  cv::Mat sheet_ = draw_pose_sheet(support::tube_body(support::plain_body()), kHeight);
  int width_ = sheet_.cols / kColumns;
};

TEST_F(PoseSheet, EachImageHoldsTheWholeBody) {
  ASSERT_EQ(sheet_.rows, kRows * kHeight);
  ASSERT_EQ(sheet_.cols, kColumns * width_);
  int widest = 0;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const cv::Rect body = body_in(row, column);
      EXPECT_GT(body.x, 0) << row << " " << column;
      EXPECT_GT(body.y, 0) << row << " " << column;
      EXPECT_LT(body.br().x, width_) << row << " " << column;
      EXPECT_LT(body.br().y, kHeight) << row << " " << column;
      widest = std::max(widest, body.width);
    }
  EXPECT_GT(widest, width_ / 2) << "the bodies fill the images";
}

TEST_F(PoseSheet, RowsShowThePosesInOneScale) {
  for (int column = 0; column < kColumns; ++column) {
    const int standing = body_in(0, column).height;
    EXPECT_GT(body_in(1, column).height, 1.05 * standing) << "arms overhead";
    EXPECT_LT(body_in(3, column).height, 0.75 * standing) << "squat";
  }
  EXPECT_GT(body_in(4, 1).width, 1.5 * body_in(0, 1).width) << "the kick, from the side";
}

}  // namespace
}  // namespace doppel::pose_sheet_test
