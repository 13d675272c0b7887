#include "doppel/eval/flicker.h"

#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>
#include <vector>

#include "doppel/core/npy.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/render/mesh/face_tensor.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::flicker_test {
namespace {

constexpr int kSize = 60;

/// A camera at the origin that looks along z: 40 pixels a metre at a distance of one metre.
torch::Tensor camera() {
  const std::vector<float> p{40, 0, 30, 0, 0, 40, 30, 0, 0, 0, 1, 0};
  return torch::tensor(p).view({3, 4});
}

/// Vertices of a square in the plane of depth z, with its centre at (x, y). [4,3]
torch::Tensor square(float x, float y, float z, float half) {
  return torch::tensor(
      {{x - half, y - half, z}, {x + half, y - half, z}, {x + half, y + half, z}, {x - half, y + half, z}});
}

torch::Tensor faces(int squares) {
  std::vector<torch::Tensor> all;
  for (int s = 0; s < squares; ++s) all.push_back(torch::tensor({{0, 1, 2}, {0, 2, 3}}, torch::kInt32) + 4 * s);
  return torch::cat(all);
}

FramePair pair_of(const torch::Tensor& earlier, const torch::Tensor& later) {
  return {faces(static_cast<int>(earlier.size(0) / 4)), torch::stack({earlier, later}).contiguous(),
          torch::stack({camera(), camera()}).contiguous(), kSize};
}

cv::Mat everywhere() { return cv::Mat(kSize, kSize, CV_8UC1, cv::Scalar(255)); }

/// Colours that grow by 3, 2 and 1 levels a pixel to the right.
cv::Mat ramp(int shift) {
  cv::Mat image(kSize, kSize, CV_8UC3);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(cv::saturate_cast<std::uint8_t>(3 * (x - shift) + 20),
                                            cv::saturate_cast<std::uint8_t>(2 * (x - shift) + 20),
                                            cv::saturate_cast<std::uint8_t>(x - shift + 20));
  return image;
}

TEST(FlickerReference, ColoursThatMoveWithTheSurfaceDoNotChange) {
  // 0.1 m at a distance of 1 m are 4 pixels.
  const SurfaceFlow flow = surface_flow(pair_of(square(0, 0, 1, 0.5f), square(0.1f, 0, 1, 0.5f)));
  const ColourChange change = colour_change(flow, ramp(0), ramp(4), everywhere());
  EXPECT_NEAR(change.root_mean_square(), 0.0, 1e-3);
  // The square covers 40 x 40 pixels; at its border, not all four pixels around a point show it.
  EXPECT_GE(change.pixels, 38 * 38);
  EXPECT_LE(change.pixels, 40 * 40);
  // Colours that stay while the surface moves by 4 pixels change by 12, 8 and 4 levels.
  const ColourChange stay = colour_change(flow, ramp(0), ramp(0), everywhere());
  EXPECT_NEAR(stay.root_mean_square(), std::sqrt((144.0 + 64.0 + 16.0) / 3.0), 1e-3);
}

TEST(FlickerReference, NoiseOfTwoImagesAddsUp) {
  const SurfaceFlow flow = surface_flow(pair_of(square(0, 0, 1, 0.7f), square(0, 0, 1, 0.7f)));
  cv::Mat earlier(kSize, kSize, CV_8UC3), later(kSize, kSize, CV_8UC3);
  cv::RNG random(1);
  random.fill(earlier, cv::RNG::NORMAL, 120, 6);
  random.fill(later, cv::RNG::NORMAL, 120, 6);
  EXPECT_NEAR(colour_change(flow, earlier, later, everywhere()).root_mean_square(), 6 * std::sqrt(2.0), 0.3);
}

TEST(FlickerReference, PointsThatAnotherPartHidInTheEarlierFrameDoNotCount) {
  // In the earlier frame a nearer square covers the middle of the farther one. In the later frame it is out of sight.
  const torch::Tensor far = square(0, 0, 1, 0.5f);
  const SurfaceFlow flow =
      surface_flow(pair_of(torch::cat({far, square(0, 0, 0.5f, 0.1f)}), torch::cat({far, square(9, 9, 0.5f, 0.1f)})));
  EXPECT_EQ(flow.visible.at<std::uint8_t>(30, 30), 0);
  EXPECT_EQ(flow.visible.at<std::uint8_t>(30, 15), 255);
  EXPECT_EQ(flow.visible.at<std::uint8_t>(2, 2), 0) << "no surface here";
}

TEST(FlickerReference, OnlyPixelsInTheMaskCount) {
  const SurfaceFlow flow = surface_flow(pair_of(square(0, 0, 1, 0.5f), square(0, 0, 1, 0.5f)));
  cv::Mat where = cv::Mat::zeros(kSize, kSize, CV_8UC1);
  EXPECT_EQ(colour_change(flow, ramp(0), ramp(9), where).pixels, 0);
  where.at<std::uint8_t>(30, 30) = 1;
  EXPECT_EQ(colour_change(flow, ramp(0), ramp(9), where).pixels, 1);
}

class FlickerOfACapture : public ::testing::Test {
 protected:
  FlickerOfACapture() : dataset_(Dataset::open(make_small_capture(folder_.path(), options()))) {
    faces_ = face_tensor(load_character(dataset_.character_path()).mesh);
    const NpyArray ground_truth = read_npy(folder_.path() / "ground_truth" / "dance" / "vertices.npy");
    vertices_ = torch::tensor(ground_truth.as<float>()).view({5, -1, 3});
  }
  static SmallCaptureOptions options() {
    SmallCaptureOptions options;
    options.textured = true;
    return options;
  }
  /// The filmed images, `brighter` levels brighter in frames of odd numbers.
  ImageFunction filmed(int brighter) const {
    return [this, brighter](const ImageRequest& request) {
      const std::vector<std::vector<int>> cameras(request.samples.size(), {request.camera});
      const Batch batch = make_batch(dataset_, request.samples, cameras, {0, true, request.size});
      torch::Tensor colour = batch.image.to(torch::kFloat32);
      for (std::size_t b = 0; b < request.samples.size(); ++b)
        if (request.samples[b].frame % 2 == 1) colour[static_cast<std::int64_t>(b)] += brighter;
      return RenderedImages{colour / 255.0, batch.image_mask};
    };
  }
  SurfaceFunction surface() const {
    return [this](const std::vector<SampleId>& samples) {
      std::vector<torch::Tensor> rows;
      for (const SampleId& sample : samples) rows.push_back(vertices_[sample.frame]);
      return torch::stack(rows).contiguous();
    };
  }

  support::TemporaryFolder folder_;
  Dataset dataset_;
  torch::Tensor faces_, vertices_;
};
using FlickerOfACaptureReference = FlickerOfACapture;

TEST_F(FlickerOfACaptureReference, TheFilmedImagesFlickerAsTheyWereFilmed) {
  const FlickerResult same = evaluate_flicker(dataset_, Split::test, faces_, surface(), filmed(0), {}, "test");
  EXPECT_EQ(same.drawn.root_mean_square(), same.filmed.root_mean_square());
  EXPECT_EQ(same.to_json().at("flicker"), same.to_json().at("filmed_flicker"));
  EXPECT_GT(same.drawn.pixels, 1000);

  // Light that goes on and off by 20 levels adds 20 squared, on average over rising and falling.
  const FlickerResult blinking = evaluate_flicker(dataset_, Split::test, faces_, surface(), filmed(20), {}, "test");
  EXPECT_EQ(blinking.filmed.root_mean_square(), same.filmed.root_mean_square());
  EXPECT_NEAR(blinking.drawn.root_mean_square(), std::hypot(20.0, same.filmed.root_mean_square()), 1.0);
}

// The other figures of the evaluation must not be lost with this one, so it is left out.
TEST_F(FlickerOfACaptureReference, WithoutConsecutiveFramesThereIsNoFigure) {
  EvaluationOptions first;
  first.frames = {0};
  EXPECT_FALSE(has_flicker(dataset_, Split::test, first));
  const FlickerResult none = evaluate_flicker(dataset_, Split::test, faces_, surface(), filmed(0), first, "test");
  EXPECT_EQ(none.drawn.pixels, 0);
  EXPECT_TRUE(none.to_json().empty());
  EXPECT_TRUE(none.to_json().is_object());
  first.frames = {0, 1};
  EXPECT_TRUE(has_flicker(dataset_, Split::test, first));
}

}  // namespace
}  // namespace doppel::flicker_test
