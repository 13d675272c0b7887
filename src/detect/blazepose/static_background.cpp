#include "doppel/detect/blazepose/static_background.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/repeated_chroma.h"

namespace doppel {

namespace {

constexpr int kMaxFrames = 41, kMinFrames = 7;
constexpr double kMemory = 256.0 * 1024 * 1024;
constexpr double kBytesPerPixel = 4;  // colour and mask
constexpr int kMinSamples = 5;        // of a pixel
constexpr int kPossiblyPerson = 51;   // probability 0.2
constexpr double kMarginInCells = 4;  // cells of the network's mask: where its outline may be wrong
constexpr int kMaxDeviation = 18;     // median of |r - r'| + |g - g'| + |b - b'|; noise of sigma 4 gives 10
constexpr double kSteadyShare = 0.5;  // of the observed pixels

constexpr double kCellsOfPerson = 200;  // a person is about that high in BlazePose's mask

using Samples = std::array<std::array<std::uint8_t, kMaxFrames>, 3>;

std::uint8_t median(std::uint8_t* values, int count) {
  std::nth_element(values, values + count / 2, values + count);
  return values[count / 2];
}

/// The samples of a pixel over the images. @param free [images] 255 where the background may be visible
int gather(const std::vector<cv::Mat>& images, const std::vector<cv::Mat>& free, int row, int column,
           Samples& samples) {
  int count = 0;
  for (std::size_t i = 0; i < images.size() && count < kMaxFrames; ++i) {
    if (free[i].at<std::uint8_t>(row, column) == 0) continue;
    const cv::Vec3b& colour = images[i].at<cv::Vec3b>(row, column);
    for (int k = 0; k < 3; ++k) samples[k][count] = colour[k];
    ++count;
  }
  return count;
}

/// The median distance of the samples from a colour.
int deviation(const Samples& samples, int count, const cv::Vec3b& colour) {
  std::array<std::uint8_t, kMaxFrames> distances{};
  for (int i = 0; i < count; ++i) {
    int sum = 0;
    for (int k = 0; k < 3; ++k) sum += std::abs(samples[k][i] - colour[k]);
    distances[i] = static_cast<std::uint8_t>(std::min(sum, 255));
  }
  return median(distances.data(), count);
}

void check(const cv::Mat& image, const cv::Mat& mask) {
  if (image.type() != CV_8UC3 || mask.type() != CV_8U || image.size() != mask.size() || image.empty())
    fail<UsageError>(
        "learning a background: an image has {}x{} pixels and {} channels, its mask {}x{} and {}; expected 8-bit "
        "colour images and 8-bit masks of one channel and the same size",
        image.cols, image.rows, image.channels(), mask.cols, mask.rows, mask.channels());
}

}  // namespace

double StaticBackground::known_share() const {
  return known.empty() ? 0.0 : static_cast<double>(cv::countNonZero(known)) / static_cast<double>(known.total());
}

StaticBackground learn_background(const std::vector<cv::Mat>& images, const std::vector<cv::Mat>& masks) {
  if (images.size() != masks.size())
    fail<UsageError>("learning a background: {} images and {} masks; expected a mask for each image", images.size(),
                     masks.size());
  if (images.empty()) return {};
  std::vector<cv::Mat> kept, free;
  for (std::size_t i = 0; i < images.size(); ++i) {
    check(images[i], masks[i]);
    if (images[i].size() != images[0].size()) continue;
    kept.push_back(smooth_repeated_chroma(images[i]));
    const cv::Mat person = masks[i] >= kPossiblyPerson;
    const int margin = static_cast<int>(kMarginInCells * mask_cell(person) + 0.5);
    cv::Mat near;
    cv::dilate(person, near, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * margin + 1, 2 * margin + 1}));
    free.push_back(~near);
  }
  StaticBackground background{cv::Mat::zeros(images[0].size(), CV_8UC3), cv::Mat::zeros(images[0].size(), CV_8U)};
  Samples samples{};
  long observed = 0, steady = 0;
  for (int row = 0; row < background.known.rows; ++row)
    for (int column = 0; column < background.known.cols; ++column) {
      const int count = gather(kept, free, row, column, samples);
      if (count < kMinSamples) continue;
      cv::Vec3b& colour = background.colour.at<cv::Vec3b>(row, column);
      for (int k = 0; k < 3; ++k) {
        auto values = samples[k];
        colour[k] = median(values.data(), count);
      }
      ++observed;
      if (deviation(samples, count, colour) > kMaxDeviation) continue;
      ++steady;
      background.known.at<std::uint8_t>(row, column) = 255;
    }
  if (static_cast<double>(steady) < kSteadyShare * static_cast<double>(observed)) background.known.setTo(0);
  return background;
}

double mask_cell(const cv::Mat& person) {
  const cv::Rect box = cv::boundingRect(person);
  return std::max(1.0, std::max(box.width, box.height) / kCellsOfPerson);
}

std::vector<long> background_frames(const std::vector<long>& frames, cv::Size image) {
  const double affordable = kMemory / (kBytesPerPixel * std::max(1.0, static_cast<double>(image.area())));
  const auto most = as_size(std::clamp(affordable, double{kMinFrames}, double{kMaxFrames}));
  if (frames.size() <= most) return frames;
  std::vector<long> chosen;
  for (std::size_t i = 0; i < most; ++i) chosen.push_back(frames[i * (frames.size() - 1) / (most - 1)]);
  return chosen;
}

}  // namespace doppel
