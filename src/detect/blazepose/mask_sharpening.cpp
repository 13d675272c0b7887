#include "doppel/detect/blazepose/mask_sharpening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/repeated_chroma.h"

namespace doppel {

namespace {

constexpr int kPerson = 128;                          // probability 1/2
constexpr double kReach = 2.3;                        // cells: farther from the coarse outline, the network is right
constexpr std::array kWindows{2.3, 1.15, 1.15, 0.6};  // cells, of the passes
constexpr int kFinePasses = 2;
constexpr double kMinPartArea = 16, kMinHoleArea = 4;  // squared cells
constexpr float kDeviation = 8;                        // of colours, levels of 255
constexpr float kMaxLogit = 4;
constexpr float kBrightnessWeight = 0.15f;           // squared: brightness counts 0.4 of other differences
constexpr float kMinSupport = 1e-3f;                 // share of a window
constexpr float kMinContrast = 1;                    // squared levels
constexpr float kDarkest = 0.3f, kBrightest = 1.2f;  // of the learnt brightness

/// Sizes of one pass, pixels.
struct Pass {
  int inset;             ///< the person's colour is taken that far inside of the outline
  int offset;            ///< the background's that far outside
  int reach;             ///< pixels within this distance of the outline are decided
  double person_window;  ///< deviations of the Gaussian windows
  double background_window;
  float coverage;  ///< that a pixel of the person has at least
};

Pass coarse_pass(double window) {
  const int radius = std::max(1, static_cast<int>(window + 0.5));
  return {radius, radius, radius, window, 1.5 * window, 0.5f};
}

/// Pixels one step inside of the outline are blurred, so that their colour contains some background. A larger coverage
/// makes up for this.
Pass fine_pass() { return {1, 3, 2, 1.5, 3.0, 0.55f}; }

cv::Mat disc(double radius) {
  const int whole = std::max(1, static_cast<int>(radius + 0.5));
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * whole + 1, 2 * whole + 1});
}

/// The Gaussian means of the values near to each pixel, where `counted` is not 0. Large windows are stored at a lower
/// resolution.
class LocalMean {
 public:
  LocalMean() = default;
  LocalMean(const cv::Mat& values, const cv::Mat& counted, double window) {
    while (window / shrink_ >= 4) shrink_ *= 2;
    const cv::Size size(std::max(1, values.cols / shrink_), std::max(1, values.rows / shrink_));
    scale_ = {static_cast<float>(size.width) / static_cast<float>(values.cols),
              static_cast<float>(size.height) / static_cast<float>(values.rows)};
    sums_ = cv::Mat::zeros(values.size(), values.type());
    values.copyTo(sums_, counted);
    counted.convertTo(support_, CV_32F, 1.0 / 255.0);
    for (cv::Mat* part : {&sums_, &support_}) {
      if (shrink_ > 1) cv::resize(*part, *part, size, 0, 0, cv::INTER_AREA);
      cv::GaussianBlur(*part, *part, {}, window / shrink_);
    }
  }

  /// @return false where too little of the window counts
  template <typename Value>
  bool at(int row, int column, Value& mean) const {
    const float support = interpolate<float>(support_, row, column);
    if (support < kMinSupport) return false;
    mean = interpolate<Value>(sums_, row, column) * (1.0f / support);
    return true;
  }

 private:
  template <typename Value>
  Value interpolate(const cv::Mat& grid, int row, int column) const {
    if (shrink_ == 1) return grid.at<Value>(row, column);
    const float x = std::clamp((static_cast<float>(column) + 0.5f) * scale_[0] - 0.5f, 0.0f, grid.cols - 1.0f);
    const float y = std::clamp((static_cast<float>(row) + 0.5f) * scale_[1] - 0.5f, 0.0f, grid.rows - 1.0f);
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const int right = std::min(left + 1, grid.cols - 1), bottom = std::min(top + 1, grid.rows - 1);
    const float u = x - static_cast<float>(left), v = y - static_cast<float>(top);
    return (grid.at<Value>(top, left) * (1 - u) + grid.at<Value>(top, right) * u) * (1 - v) +
           (grid.at<Value>(bottom, left) * (1 - u) + grid.at<Value>(bottom, right) * u) * v;
  }

  int shrink_ = 1;
  cv::Vec2f scale_;
  cv::Mat sums_, support_;  ///< float
};

/// log(p / (1 - p)) of a mask's value.
std::array<float, 256> logits() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const float p = std::clamp(static_cast<float>(i) / 255.0f, 1e-3f, 1.0f - 1e-3f);
    table[i] = std::clamp(std::log(p / (1.0f - p)), -kMaxLogit, kMaxLogit);
  }
  return table;
}

/// The part of an image around the person.
class Outline {
 public:
  Outline(const cv::Mat& image, const cv::Mat& probability, const StaticBackground& background, double cell)
      : probability_(probability), mask_(probability >= kPerson) {
    image.convertTo(image_, CV_32F);
    cv::dilate(mask_, near_, disc(kReach * cell));
    cv::erode(mask_, sure_, disc(kReach * cell));
    known_ = background.known;
    if (known_.empty()) return;
    background.colour.convertTo(learnt_, CV_32F);
    cv::transform(image_, ratio_, cv::Matx13f(1, 1, 1));
    cv::Mat brightness;
    cv::transform(learnt_, brightness, cv::Matx13f(1, 1, 1));
    cv::divide(ratio_ + 3.0, brightness + 3.0, ratio_);  // 3: dark pixels are noise
    ratio_ = cv::min(cv::max(ratio_, kDarkest), kBrightest);
  }

  void refine(const Pass& pass) {
    cv::Mat to_background, to_person;  // distances, 0 on the background or on the person itself
    cv::distanceTransform(mask_, to_background, cv::DIST_L2, cv::DIST_MASK_5);
    cv::distanceTransform(~mask_, to_person, cv::DIST_L2, cv::DIST_MASK_5);
    const cv::Mat inside = to_background > pass.inset, outside = to_person > pass.offset;
    person_ = LocalMean(image_, inside, pass.person_window);
    background_ = LocalMean(image_, outside, pass.background_window);
    if (!known_.empty()) shade_ = LocalMean(ratio_, outside & known_, std::max(3.0, pass.background_window));
    const cv::Mat band = (to_person <= pass.reach) & (to_background <= pass.reach) & near_ & ~sure_;
    for (int row = 0; row < mask_.rows; ++row) decide(row, band, pass.coverage);
  }

  const cv::Mat& mask() const { return mask_; }

 private:
  /// The background's colour at a pixel. @return false where it cannot be told
  bool background_at(int row, int column, cv::Vec3f& colour) const {
    if (known_.empty() || known_.at<std::uint8_t>(row, column) == 0) return background_.at(row, column, colour);
    float shade = 1.0f;
    shade_.at(row, column, shade);
    colour = learnt_.at<cv::Vec3f>(row, column) * shade;
    return true;
  }

  void decide(int row, const cv::Mat& band, float coverage) {
    static const std::array<float, 256> kLogits = logits();
    for (int column = 0; column < mask_.cols; ++column) {
      if (band.at<std::uint8_t>(row, column) == 0) continue;
      cv::Vec3f background, body;
      if (!person_.at(row, column, body) || !background_at(row, column, background)) continue;
      const cv::Vec3f seen = image_.at<cv::Vec3f>(row, column) - background, contrast = body - background;
      const float squared = std::max(kMinContrast, product(contrast, contrast));
      const float logit = kLogits[probability_.at<std::uint8_t>(row, column)];
      const bool person = product(seen, contrast) >= coverage * squared - kDeviation * kDeviation * logit;
      mask_.at<std::uint8_t>(row, column) = person ? 255 : 0;
    }
  }

  /// The inner product of colours, in which brightness counts less than other differences.
  static float product(const cv::Vec3f& a, const cv::Vec3f& b) {
    return a.dot(b) - (1.0f - kBrightnessWeight) / 3.0f * (a[0] + a[1] + a[2]) * (b[0] + b[1] + b[2]);
  }

  cv::Mat image_, probability_, mask_, near_, sure_;
  cv::Mat known_, learnt_, ratio_;  ///< ratio of seen and learnt brightness
  LocalMean person_, background_, shade_;
};

/// Gives connected parts that are smaller than `area` pixels to the other side.
void drop_small_parts(cv::Mat& mask, std::uint8_t side, double area) {
  cv::Mat labels, statistics, centroids;
  const int count = cv::connectedComponentsWithStats(mask == side, labels, statistics, centroids, 4, CV_32S);
  std::vector<bool> small(count, false);
  for (int label = 1; label < count; ++label) small[label] = statistics.at<int>(label, cv::CC_STAT_AREA) < area;
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column)
      if (small[labels.at<int>(row, column)])
        mask.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(255 - side);
}

}  // namespace

cv::Mat sharpen_mask(const cv::Mat& image, const cv::Mat& probability, const StaticBackground& background) {
  if (image.type() != CV_8UC3 || probability.type() != CV_8U || image.size() != probability.size() || image.empty())
    fail<UsageError>(
        "sharpening a mask: the image has {}x{} pixels and {} channels, the mask {}x{} and {}; expected an 8-bit "
        "colour image and an 8-bit mask of one channel and the same size",
        image.cols, image.rows, image.channels(), probability.cols, probability.rows, probability.channels());
  const cv::Mat coarse = probability >= kPerson;
  cv::Mat result = cv::Mat::zeros(image.size(), CV_8U);
  cv::Rect box = cv::boundingRect(coarse);
  if (box.empty()) return result;
  const double cell = mask_cell(coarse);
  const int margin = static_cast<int>(8 * cell) + 12;  // the windows of the first pass
  box =
      cv::Rect(box.tl() - cv::Point(margin, margin), box.br() + cv::Point(margin, margin)) & cv::Rect({}, image.size());
  StaticBackground near;
  if (background.known.size() == image.size()) near = {background.colour(box), background.known(box)};
  Outline outline(smooth_repeated_chroma(image)(box), probability(box), near, cell);
  for (const double window : kWindows) outline.refine(coarse_pass(window * cell));
  for (int i = 0; i < kFinePasses; ++i) outline.refine(fine_pass());
  cv::Mat mask = result(box);
  outline.mask().copyTo(mask);
  drop_small_parts(mask, 255, kMinPartArea * cell * cell);
  drop_small_parts(mask, 0, kMinHoleArea * cell * cell);
  return result;
}

}  // namespace doppel
