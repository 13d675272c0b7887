#include "doppel/eval/image_metrics.h"

#include <ATen/Parallel.h>
#include <torch/utils.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/data/dataset/studio_crops.h"
#include "doppel/detect/masks/mask.h"
#include "doppel/eval/lpips.h"
#include "doppel/eval/sharpness.h"
#include "doppel/eval/whole_frames.h"

namespace doppel {

namespace {

constexpr int kWindow = 11;
constexpr double kSigma = 1.5;
constexpr int kOutlinePixels = 3;
/// Frames drawn at once; bounds the memory for images.
constexpr std::size_t kImagesAtOnce = 8;
/// Rows of windows whose SSIM is computed at once: few enough for the caches.
constexpr int kSsimRows = 48;

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

double psnr(double mse) { return mse > 0.0 ? std::min(10.0 * std::log10(255.0 * 255.0 / mse), kMaxPsnr) : kMaxPsnr; }

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

/// Adds a score that all summands have, or none.
template <typename Score>
void add_if_there(std::optional<Score>& sum, const std::optional<Score>& other) {
  if (other) (sum ? *sum : sum.emplace()) += *other;
}

PhotometricScores& operator+=(PhotometricScores& sum, const PhotometricScores& other) {
  sum.masked += other.masked;
  sum.full += other.full;
  add_if_there(sum.filmed, other.filmed);
  sum.missing_MSE += other.missing_MSE;
  sum.outline_MSE += other.outline_MSE;
  sum.foreground += other.foreground;
  sum.drawn_detail += other.drawn_detail;
  sum.filmed_detail += other.filmed_detail;
  add_if_there(sum.LPIPS, other.LPIPS);
  add_if_there(sum.whole, other.whole);
  add_if_there(sum.whole_full, other.whole_full);
  return sum;
}

PhotometricScores mean_of(const std::vector<PhotometricScores>& all) {
  PhotometricScores mean;
  for (const PhotometricScores& one : all) mean += one;
  const double count = static_cast<double>(all.size());
  std::vector<ImageScores*> parts{&mean.masked, &mean.full};
  for (std::optional<ImageScores>* part : {&mean.filmed, &mean.whole, &mean.whole_full})
    if (*part) parts.push_back(&**part);
  for (ImageScores* scores : parts)
    for (double* value : {&scores->MSE, &scores->PSNR, &scores->SSIM}) *value /= count;
  for (double* value :
       {&mean.missing_MSE, &mean.outline_MSE, &mean.foreground, &mean.drawn_detail, &mean.filmed_detail})
    *value /= count;
  if (mean.LPIPS) *mean.LPIPS /= count;
  return mean;
}

/// Sums of SSIM over the windows of an image, by channel. @param a8, b8 8-bit images
cv::Scalar summed_similarity(const cv::Mat& a8, const cv::Mat& b8) {
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
  return cv::sum(map);
}

/// The sum over all windows and channels, strip by strip in a fixed order.
double summed_strips(const cv::Mat& a8, const cv::Mat& b8) {
  const int rows = a8.rows - kWindow + 1;
  std::vector<double> sums((rows + kSsimRows - 1) / kSsimRows);
  at::parallel_for(0, static_cast<std::int64_t>(sums.size()), 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      const int first = static_cast<int>(i) * kSsimRows;
      const cv::Range strip(first, std::min(first + kSsimRows, rows) + kWindow - 1);
      const cv::Scalar sum = summed_similarity(a8.rowRange(strip), b8.rowRange(strip));
      sums[i] = sum[0] + sum[1] + sum[2];
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

/// The smallest part with all windows in which the images differ. The SSIM of equal windows is 1.
cv::Rect windows_that_differ(const cv::Mat& a8, const cv::Mat& b8) {
  cv::Mat difference;
  cv::absdiff(a8, b8, difference);
  const cv::Rect bytes = cv::boundingRect(difference.reshape(1));
  if (bytes.empty()) return {};
  const int first = bytes.x / 3, last = (bytes.x + bytes.width - 1) / 3, reach = kWindow - 1;
  return cv::Rect(first - reach, bytes.y - reach, last - first + 1 + 2 * reach, bytes.height + 2 * reach) &
         cv::Rect({}, a8.size());
}

/// The drawing as its camera would have filmed it, over the empty studio or black, cropped like the image.
/// @param filmed float32 [n,n,4] @return RGB
cv::Mat filmed_image(const torch::Tensor& filmed, const cv::Mat& studio, const CropBox& box, int size) {
  if (!filmed.defined() || filmed.sizes() != torch::IntArrayRef({box.side, box.side, 4}))
    fail<UsageError>("evaluation of images: a filmed drawing must be float [{},{},4], found [{}]", box.side, box.side,
                     filmed.defined() ? fmt::format("{}", fmt::join(filmed.sizes(), ",")) : "");
  const auto whole = bytes_of(background_crop(studio, box, box.side)).to(torch::kFloat32);
  const torch::Tensor over = filmed.narrow(2, 0, 3) * 255.0 + (1.0 - filmed.narrow(2, 3, 1)) * whole;
  const torch::Tensor rounded = over.round().clamp(0.0, 255.0).to(torch::kUInt8).contiguous();
  return crop_image(image_view(rounded), {0, 0, box.side}, size);
}

/// 255 where something is drawn.
torch::Tensor coverage_bytes(const torch::Tensor& covered) {
  return covered.ne(0).to(torch::kUInt8).mul(255).contiguous();
}

/// The drawings as 8-bit RGB [B,S,S,3] and coverage 0 or 255 [B,S,S].
RenderedImages checked(const RenderedImages& drawn, const ImageRequest& request) {
  const auto B = static_cast<std::int64_t>(request.samples.size()), S = std::int64_t{request.size};
  const bool fits = drawn.colour.defined() && drawn.covered.defined() && drawn.colour.is_floating_point() &&
                    drawn.colour.numel() == B * S * S * 3 && drawn.covered.numel() == B * S * S &&
                    drawn.colour.size(-1) == 3 && drawn.colour.size(-2) == S && drawn.covered.size(-1) == S &&
                    (!drawn.alpha.defined() || drawn.alpha.sizes() == drawn.covered.sizes());
  if (!fits)
    fail<UsageError>(
        "evaluation of images: a drawing must be float [{},{},{},3], with coverage and alpha of one shape, found [{}] "
        "and [{}]",
        B, S, S, drawn.colour.defined() ? fmt::format("{}", fmt::join(drawn.colour.sizes(), ",")) : "",
        drawn.covered.defined() ? fmt::format("{}", fmt::join(drawn.covered.sizes(), ",")) : "");
  return {eight_bit_colours(drawn.colour).view({B, S, S, 3}), coverage_bytes(drawn.covered).view({B, S, S}),
          drawn.filmed, drawn.whole, drawn.alpha.defined() ? drawn.alpha.view({B, S, S}) : torch::Tensor()};
}

/// The whole drawing as 8-bit RGB [H,W,3] and coverage 0 or 255 [H,W].
WholeDrawing checked_whole(const WholeDrawing& drawn, const PinholeCamera& camera) {
  const std::int64_t H = camera.height, W = camera.width;
  const bool fits = drawn.colour.defined() && drawn.covered.defined() && drawn.colour.is_floating_point() &&
                    drawn.colour.sizes() == torch::IntArrayRef({H, W, 3}) &&
                    drawn.covered.sizes() == torch::IntArrayRef({H, W}) &&
                    (!drawn.alpha.defined() || drawn.alpha.sizes() == drawn.covered.sizes());
  if (!fits)
    fail<UsageError>(
        "evaluation of images: a whole drawing must be float [{},{},3], with coverage and alpha of one shape, found "
        "[{}]",
        H, W, drawn.colour.defined() ? fmt::format("{}", fmt::join(drawn.colour.sizes(), ",")) : "");
  return {eight_bit_colours(drawn.colour), coverage_bytes(drawn.covered), drawn.alpha};
}

cv::Mat rgb_of(const cv::Mat& bgr) {
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return rgb;
}

/// Black outside the mask.
cv::Mat inside(const cv::Mat& image, const cv::Mat& mask) {
  cv::Mat result = cv::Mat::zeros(image.size(), image.type());
  image.copyTo(result, mask);
  return result;
}

/// A drawing over black. @param alpha as in drawn_over
cv::Mat drawn_over_black(const cv::Mat& drawn, const cv::Mat& covered, const torch::Tensor& alpha) {
  return alpha.defined() ? drawn : inside(drawn, covered);
}

/// A drawing over a background. @param alpha float32 [H,W], `drawn` is over black; undefined: 1 where covered
cv::Mat drawn_over(const cv::Mat& drawn, const cv::Mat& covered, const torch::Tensor& alpha,
                   const cv::Mat& background) {
  cv::Mat over = background.clone();
  if (!alpha.defined()) {
    drawn.copyTo(over, covered);
    return over;
  }
  const torch::Tensor sum =
      bytes_of(drawn).to(torch::kFloat32) + (1.0 - alpha.unsqueeze(2)) * bytes_of(background).to(torch::kFloat32);
  const torch::Tensor rounded = sum.round().clamp(0.0, 255.0).to(torch::kUInt8).contiguous();
  return image_view(rounded).clone();
}

/// The pixels of a mask within kOutlinePixels of its outline. The border of the image is no outline.
cv::Mat outline_of(const cv::Mat& mask) {
  constexpr int kSide = 2 * kOutlinePixels + 1;
  cv::Mat core;
  cv::erode(mask, core, cv::getStructuringElement(cv::MORPH_ELLIPSE, {kSide, kSide}));
  return mask & ~core;
}

/// @param shown the drawing over black @param over the drawing over the background @param true_person `ground_truth`
/// inside `mask`
PhotometricScores score(const cv::Mat& shown, const cv::Mat& covered, const cv::Mat& ground_truth, const cv::Mat& mask,
                        const cv::Mat& true_person, const cv::Mat& over) {
  PhotometricScores scores;
  cv::Mat missing = true_person.clone();
  scores.masked = compare_images(inside(shown, mask), true_person);
  scores.full = compare_images(over, ground_truth);
  missing.setTo(cv::Scalar::all(0), covered);
  scores.missing_MSE = mean_square(missing, cv::Mat::zeros(ground_truth.size(), CV_8UC3));
  const cv::Mat rim = outline_of(mask);
  scores.outline_MSE = mean_square(inside(shown, rim), inside(true_person, rim));
  scores.foreground = static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
  const cv::Mat both = mask & covered;
  scores.drawn_detail = detail_energy(shown, both);
  scores.filmed_detail = detail_energy(ground_truth, both);
  return scores;
}

/// Compares the drawings of one camera with its images.
class CameraComparison {
 public:
  CameraComparison(const Dataset& dataset, int camera, const ImageFunction& render, const EvaluationOptions& options)
      : dataset_(dataset), camera_(camera), render_(render), options_(options), studio_(dataset.background(camera)) {
    if (options.whole_frames) whole_frames_.emplace(dataset.capture(), dataset.camera(camera));
  }

  /// Draws B frames and compares them; frames without the person are left out.
  void add(const std::vector<SampleId>& samples) {
    BatchOptions wanted;
    wanted.past_frames = 0;
    wanted.images = true;
    const Batch batch = make_batch(dataset_, samples, std::vector<std::vector<int>>(samples.size(), {camera_}), wanted);
    const RenderedImages drawn = draw_crops(samples, batch.image_projection);
    const torch::Tensor ground_truth = batch.image.squeeze(1), mask = batch.image_mask.squeeze(1) * 255;
    for (std::size_t b = 0; b < samples.size(); ++b) {
      const auto i = static_cast<std::int64_t>(b);
      const cv::Mat person = image_view(mask[i]), image = image_view(ground_truth[i]),
                    true_person = inside(image, person);
      if (cv::countNonZero(person) == 0) continue;
      const CropBox box = dataset_.crop_box(samples[b], camera_);
      const int size = dataset_.image_size();
      const cv::Mat colour = image_view(drawn.colour[i]), covered = image_view(drawn.covered[i]);
      const torch::Tensor alpha = drawn.alpha.defined() ? drawn.alpha[i] : torch::Tensor();
      const cv::Mat shown = drawn_over_black(colour, covered, alpha);
      PhotometricScores scores = score(shown, covered, image, person, true_person,
                                       drawn_over(colour, covered, alpha, background_crop(studio_, box, size)));
      if (drawn.filmed)
        scores.filmed = compare_images(inside(filmed_image(drawn.filmed(b), studio_, box, size), person), true_person);
      if (options_.lpips) scores.LPIPS = options_.lpips->distance(inside(shown, person), true_person);
      if (whole_frames_ && drawn.whole) compare_whole(samples[b], drawn.whole(b), scores);
      scores_.push_back(scores);
    }
  }

  const std::vector<PhotometricScores>& scores() const { return scores_; }
  double seconds() const { return seconds_; }  ///< to draw all crops

 private:
  RenderedImages draw_crops(const std::vector<SampleId>& samples, const torch::Tensor& projection) {
    std::vector<int> sides;
    for (const SampleId& sample : samples) sides.push_back(dataset_.crop_box(sample, camera_).side);
    const ImageRequest request{samples, camera_, projection, dataset_.image_size(), sides};
    const auto start = std::chrono::steady_clock::now();
    const RenderedImages drawn = checked(render_(request), request);
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return drawn;
  }

  void compare_whole(const SampleId& sample, const WholeDrawing& drawing, PhotometricScores& scores) {
    const WholeDrawing drawn = checked_whole(drawing, dataset_.camera(camera_));
    const cv::Mat colour = image_view(drawn.colour), covered = image_view(drawn.covered);
    const cv::Mat mask = dataset_.mask(sample, camera_);
    const std::string& sequence = dataset_.sequences().at(as_size(sample.sequence)).name;
    const cv::Mat filmed = rgb_of(whole_frames_->read(sequence, sample.frame));
    scores.whole = compare_images(inside(drawn_over_black(colour, covered, drawn.alpha), mask), inside(filmed, mask));
    if (studio_.empty()) return;
    scores.whole_full = compare_images(drawn_over(colour, covered, drawn.alpha, rgb_of(studio_)), filmed);
  }

  const Dataset& dataset_;
  int camera_;
  const ImageFunction& render_;
  const EvaluationOptions& options_;
  cv::Mat studio_;  ///< BGR, or empty
  std::optional<WholeFrames> whole_frames_;
  std::vector<PhotometricScores> scores_;
  double seconds_ = 0.0;
};

/// Adds scores to an object of JSON; `beginning` stands before each key.
void add_scores(nlohmann::ordered_json& json, const std::string& beginning, const std::optional<ImageScores>& scores) {
  if (!scores) return;
  const nlohmann::ordered_json object = scores->to_json();
  for (const auto& [key, value] : object.items()) json[beginning + key] = value;
}

nlohmann::ordered_json scores_json(const PhotometricScores& scores) {
  nlohmann::ordered_json json = scores.masked.to_json();
  json["full"] = scores.full.to_json();
  if (scores.filmed) json["filmed"] = scores.filmed->to_json();
  json["missing_MSE"] = scores.missing_MSE;
  json["outline_MSE"] = scores.outline_MSE;
  json["foreground"] = scores.foreground;
  if (scores.filmed_detail > 0.0) json["sharpness"] = scores.drawn_detail / scores.filmed_detail;
  if (scores.LPIPS) json["LPIPS"] = *scores.LPIPS;
  add_scores(json, "whole_", scores.whole);
  add_scores(json, "whole_full_", scores.whole_full);
  return json;
}

}  // namespace

torch::Tensor ImageRequest::filmed_projection(std::size_t b) const {
  const double scale = static_cast<double>(sides.at(b)) / size;
  return projection[static_cast<std::int64_t>(b)].unsqueeze(0) *
         torch::tensor({scale, scale, 1.0}, torch::kFloat32).view({1, 1, 3, 1});
}

torch::Tensor eight_bit_colours(const torch::Tensor& colour) {
  return (colour * 255.0).round().clamp(0.0, 255.0).to(torch::kUInt8).contiguous();
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
  const auto windows_of = [](const cv::Size& size) {
    return static_cast<double>(size.height - kWindow + 1) * (size.width - kWindow + 1);
  };
  const double windows = windows_of(a8.size());
  const cv::Rect part = windows_that_differ(a8, b8);
  if (part.empty()) return 1.0;
  const double sum = summed_strips(a8(part), b8(part)) / 3.0;
  return (sum + windows - windows_of(part.size())) / windows;
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
    CameraComparison comparison(dataset, camera, render, options);
    for (std::size_t first = 0; first < samples.size(); first += kImagesAtOnce) {
      const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(first);
      const auto end = samples.begin() + static_cast<std::ptrdiff_t>(std::min(first + kImagesAtOnce, samples.size()));
      comparison.add({begin, end});
      progress.advance(end - begin);
    }
    result.seconds += comparison.seconds();
    if (comparison.scores().empty()) continue;
    means.push_back(mean_of(comparison.scores()));
    result.cameras.emplace_back(dataset.camera(camera).name, means.back());
  }
  if (means.empty()) fail("nothing to evaluate in the {} split: no frame shows the person", to_string(split));
  result.mean = mean_of(means);
  result.seconds /= static_cast<double>(samples.size() * cameras.size());
  return result;
}

nlohmann::ordered_json photometric_protocol(const Dataset& dataset, const EvaluationOptions& options) {
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
  json["outline_MSE"] =
      fmt::format("part of the masked MSE from pixels of the mask within {} pixels of its outline", kOutlinePixels);
  json["foreground"] = "share of the true mask in the crop; MSE / foreground is the MSE of the person alone";
  json["sharpness"] = fmt::format(
      "energy of the drawing above {} cycles per pixel over that of the image, inside both the true mask and the "
      "drawing",
      kDetailFrequency);
  if (options.lpips)
    json["LPIPS"] =
        fmt::format("AlexNet, version 0.1, of the crop; both images black outside the true mask; weights of {}",
                    options.lpips->source());
  if (options.flicker)
    json["flicker"] =
        "change of colour between consecutive frames at points of the drawn surface that both show, at least two "
        "pixels inside drawing and mask; root mean square over pixels and channels, of drawings and of filmed images";
  if (options.whole_frames) {
    json["whole"] =
        "the whole image at the camera's resolution, without lens distortion, read from the files of the capture; "
        "mean over all its pixels; both images black outside the true mask";
    json["whole_full"] = dataset.capture().background.empty()
                             ? "left out: the capture has no image of the empty studio"
                             : "the same images; drawing over the empty studio, against the image as filmed";
  }
  return json;
}

}  // namespace doppel
