// Film that is the drawing itself, moved by a known number of pixels.
#include "doppel/track/refine/surface_flow.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/statistics.h"

namespace doppel::surface_flow_test {
namespace {

constexpr int kSide = 160;
const cv::Rect kPerson(40, 40, 80, 80);

cv::Mat blobs() {
  cv::Mat noise(20, 20, CV_8UC3), colour;
  cv::RNG random(3);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::resize(noise, colour, {kSide, kSide}, 0, 0, cv::INTER_CUBIC);
  return colour;
}

/// A plane one metre away that covers kPerson.
DrawnSurface drawn_as(const cv::Mat& colour) {
  DrawnSurface drawn;
  drawn.box = {0, 0, kSide, kSide};
  drawn.covered = cv::Mat::zeros(kSide, kSide, CV_8U);
  drawn.covered(kPerson) = 255;
  drawn.colour = cv::Mat::zeros(kSide, kSide, CV_8UC3);
  colour(kPerson).copyTo(drawn.colour(kPerson));
  drawn.depth = cv::Mat(kSide, kSide, CV_32F, cv::Scalar(1.0));
  return drawn;
}

/// @return `image` moved by whole pixels, over black
cv::Mat moved(const cv::Mat& image, int x, int y) {
  const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, x, 0, 1, y);
  cv::Mat result;
  cv::warpAffine(image, result, shift, image.size());
  return result;
}

/// Looks along z; a point (x, y, 1) lies at the pixel (x, y).
PinholeCamera unit_camera() {
  PinholeCamera camera;
  camera.width = camera.height = kSide;
  camera.K = Eigen::Matrix3d::Identity();
  camera.R = Eigen::Matrix3d::Identity();
  camera.t = Eigen::Vector3d::Zero();
  return camera;
}

TEST(SurfaceFlowReference, FollowsTheTextureToTheFilm) {
  const DrawnSurface drawn = drawn_as(blobs());
  const cv::Mat film = moved(drawn.colour, 3, -2), mask = moved(drawn.covered, 3, -2);
  const SurfaceFlow flow = FlowFinder().find(drawn, film, mask);
  std::vector<double> errors;
  for (int y = kPerson.y; y < kPerson.br().y; ++y)
    for (int x = kPerson.x; x < kPerson.br().x; ++x)
      if (flow.sure.at<std::uint8_t>(y, x) != 0)
        errors.push_back(cv::norm(flow.flow.at<cv::Vec2f>(y, x) - cv::Vec2f(3, -2)));
  EXPECT_GT(errors.size(), 0.8 * kPerson.area());
  EXPECT_LT(median(errors), 0.2);
  EXPECT_EQ(cv::countNonZero(flow.sure & (drawn.covered == 0)), 0) << "nothing is known beside the surface";

  const AlignedFilm aligned = align_film(flow, film);
  cv::Mat difference;
  cv::absdiff(aligned.image, drawn.colour, difference);
  EXPECT_LT(cv::mean(difference, aligned.mask)[0], 6.0);
}

TEST(SurfaceFlowReference, MatchesLieWhereTheFlowLeads) {
  const DrawnSurface drawn = drawn_as(blobs());
  const SurfaceFlow flow = FlowFinder().find(drawn, moved(drawn.colour, 3, -2), moved(drawn.covered, 3, -2));
  const std::vector<Eigen::Vector3d> vertices{{80.5, 80.5, 1.0},    // drawn
                                              {160.0, 160.0, 2.0},  // hidden behind the plane
                                              {10.0, 10.0, 1.0},    // beside the surface
                                              {80.0, 80.0, -1.0}};  // behind the camera
  const auto matches = surface_matches(flow, drawn, vertices, unit_camera(), 4, 10);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].camera, 4);
  EXPECT_EQ(matches[0].vertex, 0);
  EXPECT_LT((matches[0].pixel - Eigen::Vector2d(83.5, 78.5)).norm(), 0.5);
  EXPECT_EQ(surface_matches(flow, drawn, std::vector<Eigen::Vector3d>(50, vertices[0]), unit_camera(), 0, 10).size(),
            10u);
}

TEST(SurfaceFlowReference, AlongAnEdgeThePositionIsUnknown) {
  cv::Mat stripes(kSide, kSide, CV_8UC3);
  for (int x = 0; x < kSide; ++x) stripes.col(x).setTo(cv::Scalar::all(x / 8 % 2 == 0 ? 60 : 200));
  cv::GaussianBlur(stripes, stripes, {}, 1.5);
  const DrawnSurface drawn = drawn_as(stripes);
  const SurfaceFlow flow = FlowFinder().find(drawn, drawn.colour, drawn.covered);
  const auto matches = surface_matches(flow, drawn, {{80.5, 80.5, 1.0}}, unit_camera(), 0, 10);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_GT(matches[0].sureness(0, 0), 0.9) << "across the stripes";
  EXPECT_LT(matches[0].sureness(1, 1), 0.1) << "along them";
}

TEST(SurfaceFlowReference, NothingIsKnownOfAnEmptyDrawing) {
  const cv::Mat film = blobs();
  const SurfaceFlow flow = FlowFinder().find(DrawnSurface(), film, {});
  EXPECT_TRUE(flow.empty());
  EXPECT_TRUE(surface_matches(flow, DrawnSurface(), {{1.0, 1.0, 1.0}}, unit_camera(), 0, 10).empty());
  EXPECT_EQ(cv::countNonZero(align_film(flow, film).mask), 0);
}

}  // namespace
}  // namespace doppel::surface_flow_test
