#include "doppel/eval/error_map.h"

#include <gtest/gtest.h>

#include "doppel/core/error.h"

namespace doppel::error_map_test {
namespace {

using torch::Tensor;

/// Two triangles that fill a square of two metres, three metres before the camera.
struct Square {
  Tensor vertices =
      torch::tensor({-1.0f, -1.0f, 3.0f, 1.0f, -1.0f, 3.0f, 1.0f, 1.0f, 3.0f, -1.0f, 1.0f, 3.0f}).view({4, 3});
  Tensor faces = torch::tensor({0, 1, 2, 0, 2, 3}, torch::kInt32).view({2, 3});
  PinholeCamera camera;
  Square() {
    camera.width = camera.height = 60;
    camera.K << 60, 0, 30, 0, 60, 30, 0, 0, 1;
  }
  cv::Vec3b centre(float value, double limit = 1.0) const {
    return draw_vertex_values(vertices, faces, torch::full({4}, value), camera, limit).at<cv::Vec3b>(31, 29);
  }
};

TEST(VertexValues, AreBlueAboveZeroAndRedBelow) {
  const Square square;
  const cv::Vec3b zero = square.centre(0.0f), good = square.centre(1.0f), bad = square.centre(-1.0f);
  EXPECT_EQ(zero[0], zero[2]);
  EXPECT_GT(good[0], good[2] + 100);
  EXPECT_GT(bad[2], bad[0] + 100);
  EXPECT_EQ(square.centre(5.0f), good) << "beyond the limit the colour stays";
  EXPECT_EQ(square.centre(1.0f, 2.0), square.centre(0.5f)) << "colours are relative to the limit";
  const cv::Mat image = draw_vertex_values(square.vertices, square.faces, torch::zeros({4}), square.camera, 1.0);
  EXPECT_EQ(image.at<cv::Vec3b>(2, 2), cv::Vec3b(255, 255, 255)) << "white beside the surface";
}

TEST(VertexValues, AreInterpolatedBetweenVertices) {
  const Square square;
  const Tensor values = torch::tensor({-1.0f, 1.0f, 1.0f, -1.0f});
  const cv::Mat image = draw_vertex_values(square.vertices, square.faces, values, square.camera, 1.0);
  EXPECT_GT(image.at<cv::Vec3b>(30, 15)[2], image.at<cv::Vec3b>(30, 15)[0]);
  EXPECT_GT(image.at<cv::Vec3b>(30, 45)[0], image.at<cv::Vec3b>(30, 45)[2]);
}

TEST(VertexValues, RejectALimitOfZero) {
  const Square square;
  EXPECT_THROW(square.centre(1.0f, 0.0), UsageError);
}

TEST(ErrorImprovement, RemovesTheTranslation) {
  const Tensor ground_truth = torch::rand({20, 3}, at::detail::createCPUGenerator(1));
  const Tensor shift = torch::tensor({0.1f, -0.4f, 2.0f});
  Tensor worse = ground_truth.clone();
  worse[3][1] += 0.05f;
  worse[8][1] -= 0.05f;
  const Tensor gain = error_improvement(ground_truth + shift, worse, ground_truth);
  EXPECT_NEAR(gain[3].item<float>(), 0.05f, 1e-5f);
  EXPECT_NEAR(gain[8].item<float>(), 0.05f, 1e-5f);
  EXPECT_NEAR(gain.sum().item<float>(), 0.1f, 1e-4f);
  EXPECT_NEAR(error_improvement(worse, ground_truth, ground_truth)[3].item<float>(), -0.05f, 1e-5f);
}

}  // namespace
}  // namespace doppel::error_map_test
