#include "doppel/eval/image_metrics.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/capture/mask.h"
#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/data/batch_builder.h"
#include "doppel/data/loader.h"

namespace doppel {

namespace {

constexpr int kWindow = 11;
constexpr double kSigma = 1.5;
/// Frames drawn at once; bounds the memory for images.
constexpr std::size_t kImagesAtOnce = 8;

void check_pair(const cv::Mat& a, const cv::Mat& b) {
  if (a.type() != CV_8UC3 || b.type() != CV_8UC3 || a.size() != b.size())
    fail<UsageError>(
        "images of {}x{} with {} channels and {}x{} with {} cannot be compared; both must be 8-bit, of one size, "
        "with three channels",
        a.cols, a.rows, a.channels(), b.cols, b.rows, b.channels());
}

double mean_square(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L2SQR) / (3.0 * static_cast<double>(a.total()));
}

double psnr(double mse) {
  return mse > 0.0 ? std::min(10.0 * std::log10(255.0 * 255.0 / mse), kHighestPsnr) : kHighestPsnr;
}

cv::Mat local_mean(const cv::Mat& image) {
  cv::Mat result;
  cv::GaussianBlur(image, result, {kWindow, kWindow}, kSigma, kSigma);
  const int edge = kWindow / 2;
  return result(cv::Rect(edge, edge, image.cols - 2 * edge, image.rows - 2 * edge));
}

ImageScores& operator+=(ImageScores& sum, const ImageScores& other) {
  sum.MSE += other.MSE;
  sum.PSNR += other.PSNR;
  sum.SSIM += other.SSIM;
  return sum;
}

PhotometricScores& operator+=(PhotometricScores& sum, const PhotometricScores& other) {
  sum.masked += other.masked;
  sum.full += other.full;
  if (other.filmed) (sum.filmed ? *sum.filmed : sum.filmed.emplace()) += *other.filmed;
  sum.missing_MSE += other.missing_MSE;
  sum.foreground += other.foreground;
  return sum;
}

PhotometricScores mean_of(const std::vector<PhotometricScores>& all) {
  PhotometricScores mean;
  for (const PhotometricScores& one : all) mean += one;
  const double count = static_cast<double>(all.size());
  for (ImageScores* scores : {&mean.masked, &mean.full, mean.filmed ? &*mean.filmed : nullptr})
    if (scores)
      for (double* value : {&scores->MSE, &scores->PSNR, &scores->SSIM}) *value /= count;
  mean.missing_MSE /= count;
  mean.foreground /= count;
  return mean;
}

/// The background of a crop, RGB: the empty studio, or black.
cv::Mat background_crop(const cv::Mat& studio, const CropBox& box, int size) {
  cv::Mat result = cv::Mat::zeros(size, size, CV_8UC3);
  if (!studio.empty() && !box.empty()) cv::cvtColor(crop_image(studio, box, size), result, cv::COLOR_BGR2RGB);
  return result;
}

/// The drawing as its camera would have filmed it, over the empty studio or black, cropped like the image.
/// @param filmed float32 [n,n,4] @return RGB
cv::Mat filmed_image(const torch::Tensor& filmed, const cv::Mat& studio, const CropBox& box, int size) {
  if (!filmed.defined() || filmed.sizes() != torch::IntArrayRef({box.side, box.side, 4}))
    fail<UsageError>("evaluation of images: a filmed drawing must be float [{},{},4], found [{}]", box.side, box.side,
                     filmed.defined() ? fmt::format("{}", fmt::join(filmed.sizes(), ",")) : "");
  cv::Mat behind = background_crop(studio, box, box.side);
  const auto whole = torch::from_blob(behind.data, {box.side, box.side, 3}, torch::kUInt8).to(torch::kFloat32);
  const torch::Tensor over = filmed.narrow(2, 0, 3) * 255.0 + (1.0 - filmed.narrow(2, 3, 1)) * whole;
  const torch::Tensor rounded = over.round().clamp(0.0, 255.0).to(torch::kUInt8).contiguous();
  const cv::Mat image(box.side, box.side, CV_8UC3, rounded.data_ptr<std::uint8_t>());
  return crop_image(image, {0, 0, box.side}, size);
}

/// The drawings as 8-bit RGB [B,S,S,3] and coverage 0 or 255 [B,S,S].
RenderedImages checked(const RenderedImages& drawn, const ImageRequest& request) {
  const auto B = static_cast<std::int64_t>(request.samples.size()), S = std::int64_t{request.size};
  const bool fits = drawn.colour.defined() && drawn.covered.defined() && drawn.colour.is_floating_point() &&
                    drawn.colour.numel() == B * S * S * 3 && drawn.covered.numel() == B * S * S &&
                    drawn.colour.size(-1) == 3 && drawn.colour.size(-2) == S && drawn.covered.size(-1) == S;
  if (!fits)
    fail<UsageError>(
        "evaluation of images: a drawing must be float [{},{},{},3] with its coverage, found [{}] and [{}]", B, S, S,
        drawn.colour.defined() ? fmt::format("{}", fmt::join(drawn.colour.sizes(), ",")) : "",
        drawn.covered.defined() ? fmt::format("{}", fmt::join(drawn.covered.sizes(), ",")) : "");
  const torch::Tensor colour = (drawn.colour * 255.0).round().clamp(0.0, 255.0).to(torch::kUInt8);
  return {colour.reshape({B, S, S, 3}).contiguous(),
          drawn.covered.ne(0).to(torch::kUInt8).mul(255).reshape({B, S, S}).contiguous(), drawn.filmed};
}

cv::Mat image_of(const torch::Tensor& images, std::int64_t index, int size, int type) {
  const torch::Tensor image = images[index];
  return cv::Mat(size, size, type, image.data_ptr<std::uint8_t>());  // the batch keeps the memory alive
}

/// Black outside the mask.
cv::Mat inside(const cv::Mat& image, const cv::Mat& mask) {
  cv::Mat result = cv::Mat::zeros(image.size(), image.type());
  image.copyTo(result, mask);
  return result;
}

/// @param true_person `truth` inside `mask`
PhotometricScores score(const cv::Mat& drawn, const cv::Mat& covered, const cv::Mat& truth, const cv::Mat& mask,
                        const cv::Mat& true_person, const cv::Mat& background) {
  PhotometricScores scores;
  cv::Mat over = background.clone(), missing = true_person.clone();
  drawn.copyTo(over, covered);
  scores.masked = compare_images(inside(inside(drawn, covered), mask), true_person);
  scores.full = compare_images(over, truth);
  missing.setTo(cv::Scalar::all(0), covered);
  scores.missing_MSE = mean_square(missing, cv::Mat::zeros(truth.size(), CV_8UC3));
  scores.foreground = static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
  return scores;
}

/// Scores of B frames in one camera; frames without the person are left out.
void score_frames(const Dataset& dataset, const std::vector<SampleId>& samples, int camera, const cv::Mat& studio,
                  const ImageFunction& render, std::vector<PhotometricScores>& scores, double& seconds) {
  BatchOptions wanted;
  wanted.past_frames = 0;
  wanted.images = true;
  const Batch batch = make_batch(dataset, samples, std::vector<std::vector<int>>(samples.size(), {camera}), wanted);
  const int size = dataset.image_size();
  std::vector<int> sides;
  for (const SampleId& sample : samples) sides.push_back(dataset.crop_box(sample, camera).side);
  const ImageRequest request{samples, camera, batch.image_projection, size, sides};
  const auto start = std::chrono::steady_clock::now();
  const RenderedImages drawn = checked(render(request), request);
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const torch::Tensor truth = batch.image.squeeze(1), mask = batch.image_mask.squeeze(1) * 255;
  for (std::size_t b = 0; b < samples.size(); ++b) {
    const auto i = static_cast<std::int64_t>(b);
    const cv::Mat person = image_of(mask, i, size, CV_8UC1);
    if (cv::countNonZero(person) == 0) continue;
    const cv::Mat image = image_of(truth, i, size, CV_8UC3), true_person = inside(image, person);
    const CropBox box = dataset.crop_box(samples[b], camera);
    scores.push_back(score(image_of(drawn.colour, i, size, CV_8UC3), image_of(drawn.covered, i, size, CV_8UC1), image,
                           person, true_person, background_crop(studio, box, size)));
    if (!drawn.filmed) continue;
    scores.back().filmed =
        compare_images(inside(filmed_image(drawn.filmed(b), studio, box, size), person), true_person);
  }
}

nlohmann::ordered_json scores_json(const PhotometricScores& scores) {
  nlohmann::ordered_json json = scores.masked.to_json();
  json["full"] = scores.full.to_json();
  if (scores.filmed) json["filmed"] = scores.filmed->to_json();
  json["missing_MSE"] = scores.missing_MSE;
  json["foreground"] = scores.foreground;
  return json;
}

}  // namespace

torch::Tensor ImageRequest::filmed_projection(std::size_t b) const {
  const double scale = static_cast<double>(sides.at(b)) / size;
  return projection[static_cast<std::int64_t>(b)].unsqueeze(0) *
         torch::tensor({scale, scale, 1.0}, torch::kFloat32).view({1, 1, 3, 1});
}

nlohmann::ordered_json ImageScores::to_json() const { return {{"MSE", MSE}, {"PSNR", PSNR}, {"SSIM", SSIM}}; }

nlohmann::ordered_json PhotometricResult::to_json() const {
  nlohmann::ordered_json json = scores_json(mean);
  json["seconds"] = seconds;
  for (const auto& [name, scores] : cameras) json["cameras"][name] = scores_json(scores);
  return json;
}

double structural_similarity(const cv::Mat& a8, const cv::Mat& b8) {
  check_pair(a8, b8);
  if (a8.cols < kWindow || a8.rows < kWindow)
    fail<UsageError>("SSIM needs images of at least {} pixels a side; these are {}x{}", kWindow, a8.cols, a8.rows);
  constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;
  cv::Mat a, b;
  a8.convertTo(a, CV_64F);
  b8.convertTo(b, CV_64F);
  const cv::Mat mean_a = local_mean(a), mean_b = local_mean(b);
  const cv::Mat mean_aa = mean_a.mul(mean_a), mean_bb = mean_b.mul(mean_b), mean_ab = mean_a.mul(mean_b);
  const cv::Mat variance_a = local_mean(a.mul(a)) - mean_aa, variance_b = local_mean(b.mul(b)) - mean_bb;
  const cv::Mat covariance = local_mean(a.mul(b)) - mean_ab;
  const cv::Scalar c1 = cv::Scalar::all(kC1), c2 = cv::Scalar::all(kC2);
  cv::Mat above, below, map;
  cv::multiply(2.0 * mean_ab + c1, 2.0 * covariance + c2, above);
  cv::multiply(mean_aa + mean_bb + c1, variance_a + variance_b + c2, below);
  cv::divide(above, below, map);
  const cv::Scalar channels = cv::mean(map);
  return (channels[0] + channels[1] + channels[2]) / 3.0;
}

ImageScores compare_images(const cv::Mat& a, const cv::Mat& b) {
  ImageScores scores;
  scores.SSIM = structural_similarity(a, b);
  scores.MSE = mean_square(a, b);
  scores.PSNR = psnr(scores.MSE);
  return scores;
}

PhotometricResult evaluate_images(const Dataset& dataset, Split split, const ImageFunction& render,
                                  const EvaluationOptions& options, const std::string& title) {
  torch::NoGradGuard no_grad;
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  PhotometricResult result;
  std::vector<PhotometricScores> means;
  Progress progress(title, static_cast<std::int64_t>(samples.size() * cameras.size()));
  for (const int camera : cameras) {
    const cv::Mat studio = dataset.background(camera);
    std::vector<PhotometricScores> scores;
    for (std::size_t first = 0; first < samples.size(); first += kImagesAtOnce) {
      const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(first);
      const auto end = samples.begin() + static_cast<std::ptrdiff_t>(std::min(first + kImagesAtOnce, samples.size()));
      score_frames(dataset, {begin, end}, camera, studio, render, scores, result.seconds);
      progress.advance(end - begin);
    }
    if (scores.empty()) continue;
    means.push_back(mean_of(scores));
    result.cameras.emplace_back(dataset.camera(camera).name, means.back());
  }
  if (means.empty()) fail("nothing to evaluate in the {} split: no frame shows the person", to_string(split));
  result.mean = mean_of(means);
  result.seconds /= static_cast<double>(samples.size() * cameras.size());
  return result;
}

nlohmann::ordered_json photometric_protocol(const Dataset& dataset) {
  nlohmann::ordered_json json;
  json["metric"] =
      "MSE, PSNR, SSIM of 8-bit RGB over all pixels of the prepared crop; mean over frames, then over cameras";
  json["crop"] = dataset.image_size();
  json["masked"] = "both images black outside the true mask";
  json["full"] = dataset.capture().background.empty() ? "drawing over black, against the image as filmed"
                                                      : "drawing over the empty studio, against the image as filmed";
  json["filmed"] =
      "drawing averaged over each pixel of the camera, over the same background, resized as the image was; both black"
      " outside the true mask";
  json["SSIM"] =
      fmt::format("Gaussian window {} x {}, sigma {}, range 255, windows inside the image, mean over channels", kWindow,
                  kWindow, kSigma);
  json["missing_MSE"] = "part of the masked MSE from pixels of the mask where nothing is drawn; the rest is colour";
  json["foreground"] = "share of the true mask in the crop; MSE / foreground is the MSE of the person alone";
  return json;
}

}  // namespace doppel
