#include "doppel/detect/blazepose/mask_sharpening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/colour_product.h"
#include "doppel/detect/blazepose/repeated_chroma.h"

namespace doppel {

namespace {

constexpr int kPerson = 128;                          // probability 1/2
constexpr int kUnsure = 26, kSure = 230;              // probabilities 0.1 and 0.9: the network is unsure between them
constexpr double kReach = 2.3;                        // cells: farther from the coarse outline, a sure network is right
constexpr std::array kWindows{2.3, 1.15, 1.15, 0.6};  // cells, of the passes
constexpr int kFinePasses = 2;
constexpr double kFineWindow = 0.85;                   // cells: the larger a person, the wider the blur of the outline
constexpr double kMinFineWindow = 1.5;                 // pixels
constexpr double kMinHalvedCell = 3;                   // pixels: larger ones do not need all pixels of the image
constexpr double kMinPartArea = 16, kMinHoleArea = 4;  // squared cells
constexpr float kDeviation = 8;                        // of colours, levels of 255
constexpr float kMaxLogit = 4;
constexpr float kMinSupport = 1e-3f;                 // share of a window
constexpr float kMinContrast = 1;                    // squared levels
constexpr float kDarkest = 0.3f, kBrightest = 1.2f;  // of the learnt brightness

/// Sizes of one pass, pixels.
struct Pass {
  int inset;             ///< the person's colour is taken that far inside of the outline
  int offset;            ///< the background's that far outside
  int reach;             ///< pixels within this distance of the outline are decided; so are unsure ones anywhere
  double person_window;  ///< deviations of the Gaussian windows
  double background_window;
  float coverage;  ///< that a pixel of the person has at least
};

Pass coarse_pass(double window) {
  const int radius = std::max(1, static_cast<int>(std::lround(window)));
  return {radius, radius, radius, window, 1.5 * window, 0.5f};
}

/// Pixels one step inside of the outline are blurred, so that their colour contains some background. A larger coverage
/// makes up for this. @param cell pixels
Pass fine_pass(double cell) {
  const double window = std::max(kMinFineWindow, kFineWindow * cell);
  return {1, 3, 2, window, 2.0 * window, 0.55f};
}

/// The pixels within a distance of a mask, 255.
cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat disc(2 * radius + 1, 2 * radius + 1, CV_8U);
  for (int y = -radius; y <= radius; ++y)
    for (int x = -radius; x <= radius; ++x)
      disc.at<std::uint8_t>(y + radius, x + radius) = x * x + y * y <= radius * radius;
  cv::Mat result;
  cv::dilate(mask, result, disc);
  return result;
}

/// The pixels of a mask whose distance from all others is larger, 255.
cv::Mat shrunk(const cv::Mat& mask, int radius) { return ~grown(~mask, radius); }

/// 255 within a distance of the outline of a mask.
cv::Mat band_around(const cv::Mat& mask, int reach) { return grown(mask, reach) & ~shrunk(mask, reach); }

/// The Gaussian means of the values near to each pixel, where `counted` is not 0. Large windows are stored at a lower
/// resolution.
/// @tparam Value a vector whose last element is 1
template <typename Value>
class LocalMean {
 public:
  LocalMean() = default;
  LocalMean(const cv::Mat_<Value>& values, const cv::Mat& counted, double window) {
    while (window / (1 << shift_) >= 2) ++shift_;
    const int cell = 1 << shift_;
    sums_.create((values.rows + cell - 1) >> shift_, (values.cols + cell - 1) >> shift_);
    sums_.setTo(Value::all(0));
    for (int row = 0; row < values.rows; ++row) {
      const Value* value = values[row];
      const std::uint8_t* counts = counted.ptr(row);
      Value* sums = sums_[row >> shift_];
      for (int column = 0; column < values.cols; ++column)
        if (counts[column] != 0) sums[column >> shift_] += value[column];
    }
    cv::GaussianBlur(sums_, sums_, {}, window / cell);
  }

  /// @return false where too little of the window counts
  bool at(int row, int column, Value& mean) const {
    mean = interpolate(row, column);
    const float support = mean[Value::channels - 1];
    if (support < kMinSupport * static_cast<float>(1 << (2 * shift_))) return false;
    mean *= 1.0f / support;
    return true;
  }

 private:
  Value interpolate(int row, int column) const {
    if (shift_ == 0) return sums_(row, column);
    const auto in_cells = [this](int pixel, int cells) {
      const float position = (static_cast<float>(pixel) + 0.5f) / static_cast<float>(1 << shift_) - 0.5f;
      return std::clamp(position, 0.0f, static_cast<float>(cells - 1));
    };
    const float x = in_cells(column, sums_.cols), y = in_cells(row, sums_.rows);
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const int right = std::min(left + 1, sums_.cols - 1), bottom = std::min(top + 1, sums_.rows - 1);
    const float u = x - static_cast<float>(left), v = y - static_cast<float>(top);
    return (sums_(top, left) * (1 - u) + sums_(top, right) * u) * (1 - v) +
           (sums_(bottom, left) * (1 - u) + sums_(bottom, right) * u) * v;
  }

  int shift_ = 0;  ///< a cell has 2^shift x 2^shift pixels
  cv::Mat_<Value> sums_;
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

using Colour = cv::Vec4f;  // blue, green, red, 1
using Shade = cv::Vec2f;   // a ratio of brightness, 1

/// The part of an image around the person.
class Outline {
 public:
  Outline(const cv::Mat& image, const cv::Mat& probability, const StaticBackground& background, double cell)
      : probability_(probability),
        mask_(probability >= kPerson),
        undecided_(band_around(mask_, static_cast<int>(std::lround(kReach * cell)))),
        unsure_((probability >= kUnsure) & (probability < kSure)),
        known_(background.known),
        image_(with_ones(image)) {
    if (known_.empty()) return;
    learnt_ = with_ones(background.colour);
    shades_.create(image.size());
    for (int row = 0; row < image.rows; ++row)
      for (int column = 0; column < image.cols; ++column) {
        const float ratio = (brightness(image_(row, column)) + 3.0f) / (brightness(learnt_(row, column)) + 3.0f);
        shades_(row, column) = {std::clamp(ratio, kDarkest, kBrightest), 1.0f};  // 3: dark pixels are noise
      }
  }

  void refine(const Pass& pass) {
    const cv::Mat inside = shrunk(mask_, pass.inset), outside = ~grown(mask_, pass.offset);
    person_ = LocalMean<Colour>(image_, inside, pass.person_window);
    background_ = LocalMean<Colour>(image_, outside, pass.background_window);
    if (!known_.empty()) shade_ = LocalMean<Shade>(shades_, outside & known_, std::max(3.0, pass.background_window));
    const cv::Mat band = (band_around(mask_, pass.reach) & undecided_) | unsure_;
    for (int row = 0; row < mask_.rows; ++row) decide(row, band, pass.coverage);
  }

  const cv::Mat& mask() const { return mask_; }
  /// Begins with another mask than that of the network.
  void begin_with(const cv::Mat& mask) { mask_ = mask; }

 private:
  static cv::Mat_<Colour> with_ones(const cv::Mat& image) {
    cv::Mat_<Colour> result(image.size());
    for (int row = 0; row < image.rows; ++row)
      for (int column = 0; column < image.cols; ++column) {
        const auto& pixel = image.at<cv::Vec3b>(row, column);
        result(row, column) = {static_cast<float>(pixel[0]), static_cast<float>(pixel[1]), static_cast<float>(pixel[2]),
                               1.0f};
      }
    return result;
  }

  /// The background's colour at a pixel. @return false where it cannot be told
  bool background_at(int row, int column, Colour& colour) const {
    if (known_.empty() || known_.at<std::uint8_t>(row, column) == 0) return background_.at(row, column, colour);
    Shade shade(1.0f, 1.0f);
    if (!shade_.at(row, column, shade)) shade[0] = 1.0f;
    colour = learnt_(row, column) * shade[0];
    return true;
  }

  void decide(int row, const cv::Mat& band, float coverage) {
    static const std::array<float, 256> kLogits = logits();
    for (int column = 0; column < mask_.cols; ++column) {
      if (band.at<std::uint8_t>(row, column) == 0) continue;
      Colour background, body;
      if (!person_.at(row, column, body) || !background_at(row, column, background)) continue;
      const Colour seen = image_(row, column) - background, contrast = body - background;
      const float squared = std::max(kMinContrast, colour_product(contrast, contrast));
      const float logit = kLogits[probability_.at<std::uint8_t>(row, column)];
      const bool person = colour_product(seen, contrast) >= coverage * squared - kDeviation * kDeviation * logit;
      mask_.at<std::uint8_t>(row, column) = person ? 255 : 0;
    }
  }

  cv::Mat probability_, mask_, undecided_, unsure_, known_;
  cv::Mat_<Colour> image_, learnt_;
  cv::Mat_<Shade> shades_;  ///< of seen and learnt brightness
  LocalMean<Colour> person_, background_;
  LocalMean<Shade> shade_;
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

/// What is known of an image.
struct Scene {
  cv::Mat image, probability;
  StaticBackground background;
  double cell = 0.0;  ///< pixels
};

Scene halved(const Scene& scene) {
  const auto half = [](const cv::Mat& image) {
    cv::Mat result;
    if (!image.empty()) cv::resize(image, result, {}, 0.5, 0.5, cv::INTER_AREA);
    return result;
  };
  Scene small{half(scene.image), half(scene.probability), {}, 0.5 * scene.cell};
  if (!scene.background.known.empty())
    small.background = {half(scene.background.colour), half(scene.background.known) == 255};
  return small;
}

/// The passes with large windows.
cv::Mat coarse_mask(const Scene& scene) {
  const bool even = scene.image.cols % 2 == 0 && scene.image.rows % 2 == 0;
  if (even && scene.cell >= kMinHalvedCell) {
    cv::Mat mask;
    cv::resize(coarse_mask(halved(scene)), mask, {}, 2, 2, cv::INTER_LINEAR);
    return mask >= 128;
  }
  Outline outline(scene.image, scene.probability, scene.background, scene.cell);
  for (const double window : kWindows) outline.refine(coarse_pass(window * scene.cell));
  return outline.mask();
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
  const cv::Point even(2 * (std::max(0, box.x - margin) / 2), 2 * (std::max(0, box.y - margin) / 2));  // of the chroma
  box = cv::Rect(even, box.br() + cv::Point(margin, margin)) & cv::Rect({}, image.size());
  Scene scene{smooth_repeated_chroma(image(box)), probability(box), {}, cell};
  if (background.known.size() == image.size()) scene.background = {background.colour(box), background.known(box)};
  Outline outline(scene.image, scene.probability, scene.background, cell);
  outline.begin_with(coarse_mask(scene));
  for (int i = 0; i < kFinePasses; ++i) outline.refine(fine_pass(cell));
  cv::Mat mask = result(box);
  outline.mask().copyTo(mask);
  drop_small_parts(mask, 255, kMinPartArea * cell * cell);
  drop_small_parts(mask, 0, kMinHoleArea * cell * cell);
  return result;
}

}  // namespace doppel
