#include "doppel/eval/image_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/eval/lpips.h"
#include "eval/lpips_weights.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::image_metrics_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

cv::Mat plain(int grey, int size = 20) { return cv::Mat(size, size, CV_8UC3, cv::Scalar::all(grey)); }

cv::Mat noise(int width, int height, std::uint64_t seed) {
  cv::Mat image(height, width, CV_8UC3);
  cv::RNG(seed).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

TEST(ImageScoresReference, PlainImages) {
  const ImageScores scores = compare_images(plain(100), plain(110));
  EXPECT_DOUBLE_EQ(scores.MSE, 100.0);
  EXPECT_NEAR(scores.PSNR, 10 * std::log10(255.0 * 255.0 / 100.0), 1e-12);
  const double c1 = 2.55 * 2.55;  // without contrast only the means count
  EXPECT_NEAR(scores.SSIM, (2 * 100 * 110 + c1) / (100 * 100 + 110 * 110 + c1), 1e-9);
}

TEST(ImageScoresReference, EqualImages) {
  const cv::Mat image = noise(31, 22, 1);
  const ImageScores scores = compare_images(image, image.clone());
  EXPECT_EQ(scores.MSE, 0.0);
  EXPECT_EQ(scores.PSNR, kMaxPsnr);
  EXPECT_NEAR(scores.SSIM, 1.0, 1e-12);
}

TEST(ImageScoresReference, OneChannelOff) {
  cv::Mat image = plain(50);
  image.setTo(cv::Scalar(50, 56, 50));
  EXPECT_DOUBLE_EQ(compare_images(plain(50), image).MSE, 12.0);
}

// An image of 11 x 11 has one window; its sums are written out here.
TEST(ImageScoresReference, SsimOfOneWindowByHand) {
  const cv::Mat a = noise(11, 11, 1), b = noise(11, 11, 2) / 2 + a / 2;
  double ssim = 0.0;
  for (int channel = 0; channel < 3; ++channel) {
    double weights = 0, ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
    for (int y = 0; y < 11; ++y)
      for (int x = 0; x < 11; ++x) {
        const double w = std::exp(-((x - 5) * (x - 5) + (y - 5) * (y - 5)) / (2 * 1.5 * 1.5));
        const double va = a.at<cv::Vec3b>(y, x)[channel], vb = b.at<cv::Vec3b>(y, x)[channel];
        weights += w;
        ma += w * va;
        mb += w * vb;
        aa += w * va * va;
        bb += w * vb * vb;
        ab += w * va * vb;
      }
    for (double* sum : {&ma, &mb, &aa, &bb, &ab}) *sum /= weights;
    const double c1 = 6.5025, c2 = 58.5225;
    ssim += (2 * ma * mb + c1) * (2 * (ab - ma * mb) + c2) /
            ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2)) / 3;
  }
  EXPECT_NEAR(structural_similarity(a, b), ssim, 1e-9);
  EXPECT_NEAR(structural_similarity(b, a), ssim, 1e-9);
}

// Large images are compared in strips. The windows of two parts, put together, are those of the whole.
TEST(ImageScoresReference, SsimOfATallImageIsTheMeanOverItsWindows) {
  const cv::Mat a = noise(40, 1100, 1), b = noise(40, 1100, 2) / 2 + a / 2;
  const auto part = [&](int from, int to) { return structural_similarity(a.rowRange(from, to), b.rowRange(from, to)); };
  EXPECT_NEAR(structural_similarity(a, b), (590 * part(0, 600) + 500 * part(590, 1100)) / 1090, 1e-9);
}

// Equal windows are not computed. A border that is equal in both images adds windows of SSIM 1, and those that reach
// into the images.
TEST(ImageScoresReference, SsimCountsEqualWindowsAsOne) {
  const cv::Mat a = noise(60, 70, 1), whole = noise(60, 70, 2);
  for (const cv::Rect& part : {cv::Rect(0, 0, 1, 1), cv::Rect(59, 69, 1, 1), cv::Rect(20, 30, 7, 5)}) {
    cv::Mat b = a.clone();
    whole(part).copyTo(b(part));
    // By the mean over all windows, one by one.
    double sum = 0;
    for (int y = 0; y + 11 <= a.rows; ++y)
      for (int x = 0; x + 11 <= a.cols; ++x)
        sum += structural_similarity(a(cv::Rect(x, y, 11, 11)), b(cv::Rect(x, y, 11, 11)));
    EXPECT_NEAR(structural_similarity(a, b), sum / ((a.rows - 10) * (a.cols - 10)), 1e-9) << part;
  }
  EXPECT_EQ(structural_similarity(a, a), 1.0);
}

TEST(ImageScoresRejects, ImagesThatDoNotFit) {
  EXPECT_THAT(message_of<UsageError>([] { compare_images(plain(1, 20), plain(1, 21)); }), HasSubstr("20x20"));
  EXPECT_THAT(message_of<UsageError>([] { compare_images(plain(1, 10), plain(1, 10)); }), HasSubstr("at least 11"));
  const cv::Mat grey(20, 20, CV_8UC1, cv::Scalar(1));
  EXPECT_THAT(message_of<UsageError>([&] { compare_images(grey, grey); }), HasSubstr("1 channels"));
}

class PhotometricCapture : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new support::TemporaryFolder;
    SmallCaptureOptions options;
    options.mask_size = 64;
    options.train_frames = 2;
    options.test_frames = 10;
    dataset_ = new Dataset(Dataset::open(make_small_capture(folder_->path(), options)));
  }
  static void TearDownTestSuite() {
    delete dataset_;
    delete folder_;
  }
  /// The ground truth itself, `brighter` levels brighter, where the mask is.
  static ImageFunction ground_truth(int brighter) {
    return [brighter](const ImageRequest& request) {
      const std::vector<std::vector<int>> cameras(request.samples.size(), {request.camera});
      const Batch batch = make_batch(*dataset_, request.samples, cameras, {0, true, request.size});
      EXPECT_TRUE(torch::equal(request.projection, batch.image_projection));
      const torch::Tensor colour = (batch.image.to(torch::kFloat32) + brighter) / 255.0;
      return RenderedImages{colour * batch.image_mask.unsqueeze(-1), batch.image_mask};
    };
  }
  /// Off by 10 levels where the distance in pixels from the edge of the mask is as `wrong` says.
  static ImageFunction off_by_distance(const std::function<torch::Tensor(const torch::Tensor&)>& wrong) {
    return [wrong](const ImageRequest& request) {
      RenderedImages drawn = ground_truth(0)(request);
      const torch::Tensor off = ground_truth(10)(request).colour;
      for (std::int64_t b = 0; b < drawn.covered.size(0); ++b) {
        const torch::Tensor mask =
            (drawn.covered[b].view({request.size, request.size}) * 255).to(torch::kUInt8).clone();
        cv::Mat distance;
        cv::distanceTransform(cv::Mat(request.size, request.size, CV_8U, mask.data_ptr()), distance, cv::DIST_L2,
                              cv::DIST_MASK_PRECISE);
        const torch::Tensor away = torch::from_blob(distance.data, {request.size, request.size, 1});
        const torch::Tensor whole = drawn.colour[b].view({request.size, request.size, 3});
        drawn.colour[b].copy_(torch::where(wrong(away), off[b].view_as(whole), whole).view_as(drawn.colour[b]));
      }
      return drawn;
    };
  }
  /// The ground truth, also drawn in the whole image: from the file, inside the mask.
  static ImageFunction whole_ground_truth(int brighter) {
    return [brighter](const ImageRequest& request) {
      RenderedImages drawn = ground_truth(brighter)(request);
      drawn.whole = [request, brighter](std::size_t b) {
        const SampleId& sample = request.samples[b];
        const std::string name = dataset_->camera(request.camera).name + "_" + std::to_string(sample.frame) + ".png";
        cv::Mat image = cv::imread((folder_->path() / "dance" / ("image_" + name)).string(), cv::IMREAD_COLOR);
        cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
        const torch::Tensor pixels = torch::from_blob(image.data, {image.rows, image.cols, 3}, torch::kUInt8);
        cv::Mat mask = dataset_->mask(sample, request.camera).clone();
        return WholeDrawing{(pixels.to(torch::kFloat32) + brighter) / 255.0,
                            torch::from_blob(mask.data, {mask.rows, mask.cols}, torch::kUInt8).ne(0)};
      };
      return drawn;
    };
  }
  /// The share of the masks in the whole images.
  static double share_of_the_person() {
    const std::vector<SampleId> samples = dataset_->samples(Split::test);
    double pixels = 0.0;
    for (const SampleId& sample : samples)
      for (const int camera : dataset_->camera_indices({})) pixels += cv::countNonZero(dataset_->mask(sample, camera));
    return pixels / (static_cast<double>(samples.size() * dataset_->cameras().size()) * 128 * 128);
  }
  /// The same capture with images of its studio, which has one colour.
  static Dataset with_studio(const std::string& name) {
    Capture capture = read_capture(dataset_->folder());
    const std::filesystem::path studios = folder_->path() / "studio", copy = folder_->path() / name;
    std::filesystem::create_directories(studios);
    for (int c = 0; c < 3; ++c)
      cv::imwrite((studios / ("c" + std::to_string(c) + ".png")).string(),
                  cv::Mat(128, 128, CV_8UC3, cv::Scalar(60, 140, 60)));
    std::filesystem::copy(dataset_->folder(), copy, std::filesystem::copy_options::recursive);
    capture.background = (studios / "{name}.png").string();
    write_capture(copy / "capture.yaml", capture);
    return Dataset::open(copy);
  }
  static PhotometricResult evaluate(const ImageFunction& render, const EvaluationOptions& options = {}) {
    return evaluate_images(*dataset_, Split::test, render, options, "test");
  }
  static support::TemporaryFolder* folder_;
  static Dataset* dataset_;
};
support::TemporaryFolder* PhotometricCapture::folder_ = nullptr;
Dataset* PhotometricCapture::dataset_ = nullptr;
using PhotometricReference = PhotometricCapture;
using PhotometricRejects = PhotometricCapture;

TEST_F(PhotometricReference, TheGroundTruthHasNoError) {
  const PhotometricResult result = evaluate(ground_truth(0));
  ASSERT_EQ(result.cameras.size(), 3u);
  EXPECT_EQ(result.mean.masked.MSE, 0.0);
  EXPECT_EQ(result.mean.masked.PSNR, kMaxPsnr);
  EXPECT_NEAR(result.mean.masked.SSIM, 1.0, 1e-9);
  EXPECT_GT(result.mean.foreground, 0.05);
  EXPECT_EQ(result.to_json().at("sharpness"), 1.0);
  // The studio's colour, BGR (60, 140, 60), is not drawn.
  const double missing = (1 - result.mean.foreground) * (60 * 60 * 2 + 140 * 140) / 3.0;
  EXPECT_NEAR(result.mean.full.MSE, missing, 0.1 * missing);
}

TEST_F(PhotometricReference, AConstantErrorCountsByTheShareOfThePerson) {
  const PhotometricResult result = evaluate(ground_truth(10));
  for (const auto& [name, scores] : result.cameras)
    EXPECT_NEAR(scores.masked.MSE, 100.0 * scores.foreground, 1e-9) << name;
  EXPECT_NEAR(result.mean.masked.MSE, 100.0 * result.mean.foreground, 1e-9);
  EXPECT_EQ(result.mean.missing_MSE, 0.0);
  EXPECT_LT(result.mean.masked.SSIM, 1.0);
}

TEST_F(PhotometricReference, ErrorsWithinThreePixelsOfTheEdgeAreThePartOfTheOutline) {
  const auto near = evaluate(off_by_distance([](const torch::Tensor& away) { return away <= 2.0; })).mean;
  EXPECT_GT(near.masked.MSE, 0.0);
  EXPECT_NEAR(near.outline_MSE, near.masked.MSE, 1e-9);
  const auto inner = evaluate(off_by_distance([](const torch::Tensor& away) { return away > 4.0; })).mean;
  EXPECT_GT(inner.masked.MSE, 0.0);
  EXPECT_EQ(inner.outline_MSE, 0.0);
}

TEST_F(PhotometricReference, PixelsThatAreNotDrawnAreTheMissingPart) {
  const auto upper_half = [](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(10)(request);
    drawn.covered.slice(2, request.size / 2).zero_();
    return drawn;
  };
  const PhotometricScores mean = evaluate(upper_half).mean;
  EXPECT_GT(mean.missing_MSE, 100.0);
  // What is left is the drawn part of the person, off by 10 levels.
  EXPECT_GT(mean.masked.MSE - mean.missing_MSE, 0.0);
  EXPECT_LT(mean.masked.MSE - mean.missing_MSE, 100.0 * mean.foreground);
}

TEST_F(PhotometricReference, WhatIsDrawnOutsideTheMaskCountsInTheFullImageOnly) {
  const auto everywhere = [](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(0)(request);
    drawn.covered.fill_(1);
    return drawn;
  };
  EXPECT_EQ(evaluate(everywhere).mean.masked.MSE, 0.0);
}

/// One colour everywhere: sharp, and as filmed half transparent at twice that colour.
ImageFunction grey(float value, bool filmed) {
  return [value, filmed](const ImageRequest& request) {
    const auto count = static_cast<std::int64_t>(request.samples.size());
    RenderedImages drawn{torch::full({count, request.size, request.size, 3}, value),
                         torch::ones({count, request.size, request.size}),
                         {}};
    if (filmed)
      drawn.filmed = [value, sides = request.sides](std::size_t b) {
        return at::cat({torch::full({sides[b], sides[b], 3}, value), torch::full({sides[b], sides[b], 1}, 0.5f)}, 2);
      };
    return drawn;
  };
}

TEST_F(PhotometricReference, WhatIsFilmedLiesOverTheBackgroundByItsOpacity) {
  const PhotometricScores mean = evaluate(grey(0.4f, true)).mean;
  ASSERT_TRUE(mean.filmed.has_value());
  // No studio: black behind. The sharp drawing of that colour is then the same image.
  EXPECT_NEAR(mean.filmed->MSE, mean.masked.MSE, 1e-9);
  EXPECT_NEAR(mean.filmed->SSIM, mean.masked.SSIM, 1e-9);
  EXPECT_GT(mean.filmed->MSE, 1.0);
  EXPECT_FALSE(evaluate(grey(0.4f, false)).mean.filmed.has_value());
  EXPECT_LT(evaluate(grey(0.4f, false)).to_json().at("sharpness"), 1e-3) << "one colour has no detail";
  EXPECT_TRUE(evaluate(grey(0.4f, true)).to_json().at("cameras").at("c1").contains("filmed"));
}

/// One colour everywhere that covers the share `alpha` of each pixel.
ImageFunction veil(float value, float alpha) {
  return [value, alpha](const ImageRequest& request) {
    RenderedImages drawn = grey(value, false)(request);
    drawn.alpha = torch::full_like(drawn.covered, alpha);
    drawn.covered = drawn.alpha > 0.5;
    return drawn;
  };
}

TEST_F(PhotometricReference, ADrawingOfPartsOfPixelsCountsEverywhere) {
  const Dataset studio = with_studio("parts");
  const auto scores = [&](const ImageFunction& render) {
    return evaluate_images(studio, Split::test, render, {}, "test").mean;
  };
  const PhotometricScores opaque = scores(grey(0.4f, false)), same = scores(veil(0.4f, 1.0f));
  EXPECT_EQ(same.full.MSE, opaque.full.MSE);
  EXPECT_EQ(same.missing_MSE, opaque.missing_MSE);
  const PhotometricScores thin = scores(veil(0.4f, 0.4f));
  EXPECT_EQ(thin.masked.MSE, opaque.masked.MSE) << "over black, the colour is all that counts";
  EXPECT_NE(thin.full.MSE, opaque.full.MSE);
  EXPECT_GT(thin.missing_MSE, opaque.missing_MSE) << "less than half of a pixel is missing";
  // Nothing drawn: the empty studio.
  const auto nothing = [](const ImageRequest& request) {
    RenderedImages drawn = grey(0.0f, false)(request);
    drawn.covered.zero_();
    return drawn;
  };
  EXPECT_EQ(scores(veil(0.0f, 0.0f)).full.MSE, scores(nothing).full.MSE);
}

TEST_F(PhotometricReference, AFilmedProjectionCountsInPixelsOfTheCamera) {
  evaluate([](const ImageRequest& request) {
    for (std::size_t b = 0; b < request.samples.size(); ++b) {
      const CropBox box = dataset_->crop_box(request.samples[b], request.camera);
      EXPECT_EQ(request.sides[b], box.side);
      const Camera native = crop_camera(dataset_->camera(request.camera), box, box.side);
      const torch::Tensor found = request.filmed_projection(b);
      const auto expected = native.projection();
      for (int i = 0; i < 12; ++i)
        EXPECT_NEAR(found.flatten()[i].item<double>(), expected(i / 4, i % 4),
                    1e-3 * (1 + std::abs(expected(i / 4, i % 4))));
    }
    return ground_truth(0)(request);
  });
}

TEST_F(PhotometricRejects, FilmedDrawingsOfAnotherSize) {
  const auto wrong = [](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(0)(request);
    drawn.filmed = [sides = request.sides](std::size_t b) { return torch::zeros({sides[b] + 1, sides[b] + 1, 4}); };
    return drawn;
  };
  EXPECT_THAT(message_of<UsageError>([&] { evaluate(wrong); }), HasSubstr("filmed"));
}

TEST_F(PhotometricReference, ChosenCamerasAndFrames) {
  EvaluationOptions options;
  options.cameras = {"c1"};
  options.every = 4;
  std::vector<SampleId> asked;
  const PhotometricResult result = evaluate(
      [&](const ImageRequest& request) {
        asked.insert(asked.end(), request.samples.begin(), request.samples.end());
        EXPECT_EQ(request.camera, 1);
        return ground_truth(3)(request);
      },
      options);
  EXPECT_EQ(asked, (std::vector<SampleId>{{1, 0}, {1, 4}, {1, 8}}));
  ASSERT_EQ(result.cameras.size(), 1u);
  const auto json = result.to_json();
  EXPECT_EQ(json.at("MSE"), result.cameras[0].second.masked.MSE);
  EXPECT_EQ(json.at("cameras").at("c1").at("full").at("SSIM"), result.cameras[0].second.full.SSIM);
}

TEST_F(PhotometricReference, TheEmptyStudioStandsBehindTheDrawing) {
  // Beside the person the images agree up to compression.
  const Dataset studio = with_studio("with_studio");
  const PhotometricResult result = evaluate_images(studio, Split::test, ground_truth(0), {}, "test");
  EXPECT_LT(result.mean.full.MSE, 0.05 * evaluate(ground_truth(0)).mean.full.MSE);
  EXPECT_THAT(photometric_protocol(studio).at("full").get<std::string>(), HasSubstr("empty studio"));
  EXPECT_THAT(photometric_protocol(*dataset_).at("full").get<std::string>(), HasSubstr("black"));
  EXPECT_EQ(photometric_protocol(*dataset_).at("crop"), 64);
}

TEST_F(PhotometricReference, WholeImagesAreComparedAtTheResolutionOfTheCamera) {
  EvaluationOptions options;
  options.whole_frames = true;
  const PhotometricScores exact = evaluate(whole_ground_truth(0), options).mean;
  EXPECT_EQ(exact.whole.value().MSE, 0.0);
  EXPECT_EQ(exact.whole.value().PSNR, kMaxPsnr);
  EXPECT_NEAR(exact.whole.value().SSIM, 1.0, 1e-12);
  const PhotometricResult result = evaluate(whole_ground_truth(10), options);
  EXPECT_NEAR(result.mean.whole.value().MSE, 100.0 * share_of_the_person(), 1e-9);
  EXPECT_LT(result.mean.whole.value().SSIM, 1.0);
  EXPECT_FALSE(result.mean.whole_full);  // no image of the empty studio
  const auto json = result.to_json();
  EXPECT_EQ(json.at("whole_MSE"), result.mean.whole->MSE);
  EXPECT_EQ(json.at("whole_PSNR"), result.mean.whole->PSNR);
  EXPECT_EQ(json.at("cameras").at("c1").at("whole_SSIM"), result.cameras[1].second.whole->SSIM);
  EXPECT_FALSE(json.contains("whole_full_MSE"));
}

TEST_F(PhotometricReference, WholeImagesOverTheEmptyStudio) {
  const Dataset studio = with_studio("with_studio_for_whole_images");
  EvaluationOptions options;
  options.whole_frames = true;
  const PhotometricScores exact = evaluate_images(studio, Split::test, whole_ground_truth(0), options, "test").mean;
  EXPECT_EQ(exact.whole_full.value().MSE, 0.0);
  const PhotometricResult result = evaluate_images(studio, Split::test, whole_ground_truth(10), options, "test");
  EXPECT_NEAR(result.mean.whole_full.value().MSE, 100.0 * share_of_the_person(), 1e-9);
  EXPECT_EQ(result.to_json().at("whole_full_MSE"), result.mean.whole_full->MSE);
  // Where the drawing covers the studio it differs from the image as filmed, and the mask hides this.
  const auto everywhere = [](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(0)(request);
    drawn.whole = [request](std::size_t b) {
      WholeDrawing whole = whole_ground_truth(0)(request).whole(b);
      whole.colour = torch::where(whole.covered.unsqueeze(2), whole.colour, torch::zeros({1}));
      return WholeDrawing{whole.colour, torch::ones_like(whole.covered)};
    };
    return drawn;
  };
  const PhotometricScores black = evaluate_images(studio, Split::test, everywhere, options, "test").mean;
  EXPECT_EQ(black.whole.value().MSE, 0.0);
  EXPECT_NEAR(black.whole_full.value().MSE, (1 - share_of_the_person()) * (60 * 60 * 2 + 140 * 140) / 3.0, 1e-6);
}

TEST_F(PhotometricReference, WholeImagesAreComparedOnlyOnRequest) {
  EvaluationOptions options;
  options.whole_frames = true;
  const auto without_whole = evaluate(ground_truth(0), options);
  EXPECT_FALSE(without_whole.mean.whole);
  bool drawn_whole = false;
  const auto counted = [&](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(0)(request);
    drawn.whole = [&](std::size_t) {
      drawn_whole = true;
      return WholeDrawing{};
    };
    return drawn;
  };
  EXPECT_FALSE(evaluate(counted).to_json().contains("whole_MSE"));
  EXPECT_FALSE(drawn_whole);
  EXPECT_THAT(message_of<UsageError>([&] { evaluate(counted, options); }),
              HasSubstr("whole drawing must be float [128"));
  EXPECT_FALSE(photometric_protocol(*dataset_).contains("whole"));
  EXPECT_THAT(photometric_protocol(*dataset_, options).at("whole").get<std::string>(), HasSubstr("whole image"));
  EXPECT_THAT(photometric_protocol(*dataset_, options).at("whole_full").get<std::string>(), HasSubstr("left out"));
}

TEST_F(PhotometricReference, LpipsComparesThePersonAlone) {
  EvaluationOptions options;
  options.lpips = std::make_shared<const Lpips>(test::random_lpips_weights(1), "random weights");
  options.cameras = {"c1"};
  options.frames = {3, 4};
  const auto outside = [](const ImageRequest& request) {
    RenderedImages drawn = ground_truth(0)(request);
    drawn.colour = torch::where(drawn.covered.unsqueeze(-1).ne(0), drawn.colour, torch::ones({1}));
    drawn.covered = torch::ones_like(drawn.covered);
    return drawn;
  };
  EXPECT_EQ(evaluate(outside, options).mean.LPIPS.value(), 0.0);
  const Batch batch = make_batch(*dataset_, {{1, 3}, {1, 4}}, {{1}, {1}}, {0, true, 64});
  const torch::Tensor mask = batch.image_mask.select(1, 0).unsqueeze(1), image = batch.image.select(1, 0);
  const auto shown = [&](int brighter) {
    const torch::Tensor colour = (image.to(torch::kFloat32) + brighter).permute({0, 3, 1, 2}) * mask;
    return (colour / 127.5 - 1.0).contiguous();
  };
  const double expected = options.lpips->distance(shown(0), shown(30)).mean().item<double>();
  const PhotometricResult result = evaluate(ground_truth(30), options);
  EXPECT_GT(expected, 1e-4);
  EXPECT_NEAR(result.mean.LPIPS.value(), expected, 1e-4 * expected);
  EXPECT_EQ(result.to_json().at("LPIPS"), *result.mean.LPIPS);
  EXPECT_THAT(photometric_protocol(*dataset_, options).at("LPIPS").get<std::string>(), HasSubstr("random weights"));
  options.lpips = nullptr;
  EXPECT_FALSE(evaluate(ground_truth(30), options).to_json().contains("LPIPS"));
}

TEST_F(PhotometricReference, TheTableShowsTheNewFigures) {
  EvaluationOptions options;
  options.whole_frames = true;
  options.cameras = {"c1"};
  options.frames = {3};
  nlohmann::ordered_json evaluation;
  evaluation["protocol"] = evaluation_protocol(*dataset_, {Split::test}, options);
  evaluation["splits"]["test"]["lit"] = evaluate(whole_ground_truth(10), options).to_json();
  const double mse = evaluation["splits"]["test"]["lit"]["whole_MSE"].get<double>();
  EXPECT_THAT(evaluation_table(evaluation), HasSubstr(fmt::format("whole MSE {:.2f}", mse)));
}

TEST_F(PhotometricRejects, DrawingsOfAnotherSize) {
  const auto small = [](const ImageRequest& request) {
    const auto count = static_cast<std::int64_t>(request.samples.size());
    return RenderedImages{torch::zeros({count, 8, 8, 3}), torch::zeros({count, 8, 8})};
  };
  EXPECT_THAT(message_of<UsageError>([&] { evaluate(small); }), HasSubstr("found [8,8,8,3]"));
  EXPECT_THAT(message_of<UsageError>([&] { evaluate([](const ImageRequest&) { return RenderedImages{}; }); }),
              HasSubstr("must be float [8,64,64,3]"));
}

}  // namespace
}  // namespace doppel::image_metrics_test
