#include "doppel/detect/masks/background_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/masks/components.h"

namespace doppel {

namespace {

constexpr int kMinImages = 20;  ///< images that the model needs: fewer are repeated, or variances stay at their guess
constexpr double kMinShare = 5e-4;           ///< of the image: the smallest person
constexpr double kHoleShare = 2e-3;          ///< of the person: the smallest hole; smaller ones are gaps
constexpr double kSizeOfGaps = 1.0 / 140.0;  ///< of the image's longer side
constexpr int kHistory = 500;                // images
constexpr int kTile = 64;                    // pixels
constexpr double kRounding = 0.9;            // of the mean colour to 8 bits, in three channels
constexpr int kMedian = 3;                   // side of the window in which a single pixel counts as noise
constexpr std::uint64_t kSeed = 20210917;

// ---- exposure ----

constexpr double kLogRange = 0.25, kLogStep = 0.005;
constexpr int kBins = 2 * static_cast<int>(kLogRange / kLogStep) + 1, kReach = 3;
constexpr int kSampleStep = 3;
constexpr int kDarkest = 25, kBrightest = 245;  ///< of the compared pixels: noise below, clipped values above
constexpr double kMinAgreement = 0.1;           ///< of the compared pixels

using Histogram = std::array<double, kBins>;

double sum_around(const Histogram& votes, int bin) {
  double sum = 0.0;
  for (int i = std::max(0, bin - kReach); i <= std::min(kBins - 1, bin + kReach); ++i) sum += votes[i];
  return sum;
}

/// The ratio that most pixels agree on. The pixels of the person have no common ratio. 1 when pixels do not agree.
double common_ratio(const Histogram& votes) {
  int best = 0;
  double total = 0.0;
  for (int bin = 0; bin < kBins; ++bin) {
    total += votes[bin];
    if (sum_around(votes, bin) > sum_around(votes, best)) best = bin;
  }
  const double agreed = sum_around(votes, best);
  if (agreed <= kMinAgreement * total) return 1.0;
  double mean = 0.0;
  for (int i = std::max(0, best - kReach); i <= std::min(kBins - 1, best + kReach); ++i)
    mean += votes[i] / agreed * (i * kLogStep - kLogRange);
  return std::exp(mean);
}

/// The brightness of an image relative to the empty scene, per channel.
cv::Scalar exposure_ratio(const cv::Mat& image, const cv::Mat& empty) {
  static const std::array<double, 256> logs = [] {
    std::array<double, 256> table{};
    for (int i = 0; i < 256; ++i) table[i] = std::log(static_cast<double>(i));
    return table;
  }();
  std::array<Histogram, 3> votes{};
  for (int row = 0; row < image.rows; row += kSampleStep)
    for (int column = 0; column < image.cols; column += kSampleStep) {
      const cv::Vec3b &seen = image.at<cv::Vec3b>(row, column), &learnt = empty.at<cv::Vec3b>(row, column);
      for (int k = 0; k < 3; ++k) {
        if (std::min(seen[k], learnt[k]) < kDarkest || std::max(seen[k], learnt[k]) > kBrightest) continue;
        const double ratio = logs[seen[k]] - logs[learnt[k]];
        if (std::abs(ratio) <= kLogRange) ++votes[k][std::lround((ratio + kLogRange) / kLogStep)];
      }
    }
  return {common_ratio(votes[0]), common_ratio(votes[1]), common_ratio(votes[2])};
}

// ---- shape ----

cv::Mat disc(int size) { return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size}); }

/// An odd number of pixels in proportion to the image.
int gap_size(cv::Size image) {
  return 2 * (static_cast<int>(kSizeOfGaps * std::max(image.width, image.height)) / 2) + 1;
}

void fill_small_holes(cv::Mat& mask) { fill_holes(mask, static_cast<int>(kHoleShare * cv::countNonZero(mask))); }

/// The mask of one person without specks and gaps; empty when the result is too small to be a person.
cv::Mat clean(const cv::Mat& found, int gap) {
  cv::Mat result = cv::Mat::zeros(found.size(), CV_8U), mask;
  // Nothing happens far from the pixels found. The margin is wide enough that the background around the person stays
  // one large region, as in the whole image.
  cv::Rect box = cv::boundingRect(found);
  if (box.empty()) return result;
  const cv::Point margin(2 * gap + 16, 2 * gap + 16);
  box = cv::Rect(box.tl() - margin, box.br() + margin) & cv::Rect({}, found.size());
  cv::medianBlur(found(box), mask, 3);
  if (gap > 1) cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc(gap));
  mask = largest_component(mask);
  if (cv::countNonZero(mask) < kMinShare * static_cast<double>(found.total())) return result;
  fill_small_holes(mask);
  mask.copyTo(result(box));
  return result;
}

/// The pixels that the graph cut may change, and its initial labels. @param changed pixels that differ from the empty
/// scene, including shadows
cv::Mat cut_labels(const cv::Mat& person, const cv::Mat& changed, int gap) {
  cv::Mat inside, near;
  cv::erode(person, inside, disc(std::max(3, gap)));
  cv::dilate(changed | person, near, disc(gap + 2));
  cv::Mat labels(person.size(), CV_8U, cv::Scalar(cv::GC_BGD));
  labels.setTo(cv::GC_PR_BGD, near);
  labels.setTo(cv::GC_PR_FGD, person & changed);
  labels.setTo(cv::GC_FGD, inside);
  return labels;
}

/// Moves the outline to the edges of the image. Returns `person` when a cut is not possible.
cv::Mat refine(const cv::Mat& image, const cv::Mat& person, const cv::Mat& changed, int gap) {
  cv::Mat labels = cut_labels(person, changed, gap);
  cv::Rect box = cv::boundingRect(labels != cv::GC_BGD);
  const cv::Point margin(2 * gap + 2, 2 * gap + 2);
  box = cv::Rect(box.tl() - margin, box.br() + margin) & cv::Rect({}, image.size());
  cv::Mat window = labels(box), colours_outside, colours_inside;
  const int enough = 100;  // pixels of either label, for mixtures of five colours
  if (cv::countNonZero(window == cv::GC_FGD) < enough || cv::countNonZero(window == cv::GC_BGD) < enough) return person;
  // The mixtures start from random colours. A fixed seed gives the same mask for the same image.
  cv::RNG& random = cv::theRNG();
  const std::uint64_t state = random.state;
  random.state = kSeed;
  cv::grabCut(image(box), window, {}, colours_outside, colours_inside, 1, cv::GC_INIT_WITH_MASK);
  random.state = state;
  cv::Mat cut = largest_component((labels == cv::GC_FGD) | (labels == cv::GC_PR_FGD));
  fill_small_holes(cut);
  const double before = cv::countNonZero(person), after = cv::countNonZero(cut);
  return after > 0.7 * before && after < 1.5 * before ? cut : person;
}

}  // namespace

/// A mixture of Gaussians for each pixel of the empty scene (MOG2), in tiles. A tile is asked only where the image
/// differs from the empty scene. A pixel that is as near to the mean of its learnt colours as the smallest variance
/// allows matches the scene in any case, and single pixels beyond are the sensor's noise.
class TiledMixtures {
 public:
  TiledMixtures() = default;
  /// @param threshold, shadow as in BackgroundOptions
  TiledMixtures(double threshold, double shadow, cv::Size size);

  /// @param image 8-bit BGR @param rate share of the image in the model, 0..1
  void learn(const cv::Mat& image, double rate);
  /// The mean of the learnt colours, 8-bit BGR.
  cv::Mat empty_scene() const;
  /// 0 background, 127 shadow, 255 person, without learning. @param empty `empty_scene`
  cv::Mat classes(const cv::Mat& image, const cv::Mat& empty) const;

 private:
  struct Tile {
    cv::Rect box;
    cv::Ptr<cv::BackgroundSubtractorMOG2> model;
  };
  cv::Mat far_from(const cv::Mat& image, const cv::Mat& empty) const;

  cv::Size size_;
  std::vector<Tile> tiles_;
  int sure_ = 0;  ///< squared distance of a colour that surely matches
};

TiledMixtures::TiledMixtures(double threshold, double shadow, cv::Size size) : size_(size) {
  for (int row = 0; row < size.height; row += kTile)
    for (int column = 0; column < size.width; column += kTile) {
      tiles_.push_back({cv::Rect(column, row, kTile, kTile) & cv::Rect({}, size),
                        cv::createBackgroundSubtractorMOG2(kHistory, threshold * threshold, shadow < 1.0)});
      tiles_.back().model->setShadowThreshold(shadow);
    }
  const double nearest = threshold * std::sqrt(tiles_.front().model->getVarMin()) - kRounding;
  sure_ = static_cast<int>(std::pow(std::max(0.0, nearest), 2));
}

void TiledMixtures::learn(const cv::Mat& image, double rate) {
  cv::Mat ignored;
  for (const Tile& tile : tiles_) tile.model->apply(image(tile.box), ignored, rate);
}

cv::Mat TiledMixtures::empty_scene() const {
  cv::Mat scene(size_, CV_8UC3), part;
  for (const Tile& tile : tiles_) {
    tile.model->getBackgroundImage(part);
    part.copyTo(scene(tile.box));
  }
  return scene;
}

cv::Mat TiledMixtures::classes(const cv::Mat& image, const cv::Mat& empty) const {
  const cv::Mat far = far_from(image, empty);
  cv::Mat found = cv::Mat::zeros(size_, CV_8U), part;
  for (const Tile& tile : tiles_) {
    // One pixel more than the tile: a median at its edge sees them too.
    const cv::Rect around(tile.box.x - 1, tile.box.y - 1, tile.box.width + 2, tile.box.height + 2);
    if (cv::countNonZero(far(around & cv::Rect({}, size_))) == 0) continue;
    tile.model->apply(image(tile.box), part, 0.0);
    part.copyTo(found(tile.box));
  }
  return found;
}

/// Pixels that may not match the scene, without single ones.
cv::Mat TiledMixtures::far_from(const cv::Mat& image, const cv::Mat& empty) const {
  cv::Mat far(size_, CV_8U);
  for (int row = 0; row < image.rows; ++row) {
    const std::uint8_t *a = image.ptr(row), *b = empty.ptr(row);
    std::uint8_t* out = far.ptr(row);
    for (int i = 0; i < image.cols; ++i) {
      const int x = a[3 * i] - b[3 * i], y = a[3 * i + 1] - b[3 * i + 1], z = a[3 * i + 2] - b[3 * i + 2];
      out[i] = x * x + y * y + z * z > sure_ ? 255 : 0;
    }
  }
  cv::medianBlur(far, far, kMedian);
  return far;
}

struct BackgroundModel::Impl {
  BackgroundOptions options;
  TiledMixtures model;
  std::vector<cv::Mat> few;  ///< the first images, kept to repeat them
  int learnt = 0, shown = 0;
  cv::Size size;
  cv::Mat empty;  ///< the learnt scene; empty before the first mask

  void check(const cv::Mat& image) const {
    if (image.type() != CV_8UC3) fail("background subtraction needs 8-bit colour images");
    if (learnt > 0 && image.size() != size)
      fail("an image has {}x{} pixels, the first of the empty scene {}x{}; they must be equal", image.cols, image.rows,
           size.width, size.height);
  }

  /// The n-th image changes the model by 1 / n, so that all images have the same weight.
  void show(const cv::Mat& image) { model.learn(image, 1.0 / ++shown); }

  void finish_learning() {
    if (!empty.empty()) return;
    for (int i = 0; shown < kMinImages; ++i) show(few[as_size(i) % few.size()]);
    few.clear();
    empty = model.empty_scene();
  }
};

BackgroundModel::BackgroundModel(const BackgroundOptions& options) : impl_(std::make_unique<Impl>()) {
  if (!(options.threshold > 0.0) || !(options.shadow > 0.0) || options.shadow > 1.0)
    fail<UsageError>(
        "background subtraction with threshold {} and shadow {}: the threshold must be positive, the shadow in (0, 1]",
        options.threshold, options.shadow);
  impl_->options = options;
}

BackgroundModel::~BackgroundModel() = default;
BackgroundModel::BackgroundModel(BackgroundModel&&) noexcept = default;
BackgroundModel& BackgroundModel::operator=(BackgroundModel&&) noexcept = default;

void BackgroundModel::learn(const cv::Mat& image) {
  if (!impl_->empty.empty()) fail<UsageError>("background subtraction cannot learn after its first mask");
  impl_->check(image);
  if (impl_->learnt == 0) impl_->model = TiledMixtures(impl_->options.threshold, impl_->options.shadow, image.size());
  impl_->size = image.size();
  ++impl_->learnt;
  impl_->show(image);
  if (impl_->few.size() < kMinImages) impl_->few.push_back(image.clone());
}

cv::Mat BackgroundModel::mask(const cv::Mat& image) {
  if (impl_->learnt == 0) fail<UsageError>("background subtraction has seen no empty image yet");
  impl_->check(image);
  impl_->finish_learning();
  cv::Mat levelled;
  cv::divide(image, exposure_ratio(image, impl_->empty), levelled);
  const cv::Mat found = impl_->model.classes(levelled, impl_->empty);
  const int gap = gap_size(image.size());
  const cv::Mat person = clean(found == 255, gap);
  if (!impl_->options.refine || cv::countNonZero(person) == 0) return person;
  return refine(levelled, person, found > 0, gap);
}

}  // namespace doppel
