#include "doppel/data/capture/mask_values.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/video.h"

namespace doppel {

namespace {

constexpr int kMasks = 8;               // are looked at
constexpr std::size_t kMaxLabels = 40;  // parts of a body, or classes of a street; soft borders have more values
constexpr std::size_t kMaxNamedValues = 8;
constexpr double kLargePart = 1.0 / 3.0;

int usual_threshold() { return SequenceEntry().mask_threshold; }

std::vector<int> values_of(const MaskValues& masks) {
  std::vector<int> values;
  for (int value = 0; value < 256; ++value)
    if (masks.pixels[value] > 0) values.push_back(value);
  return values;
}

}  // namespace

int MaskValues::lowest() const {
  const std::vector<int> values = values_of(*this);
  return values.empty() ? 0 : values.front();
}

int MaskValues::highest() const {
  const std::vector<int> values = values_of(*this);
  return values.empty() ? 0 : values.back();
}

std::optional<int> MaskValues::needed_threshold() const {
  if (lowest() == highest() || highest() >= usual_threshold()) return std::nullopt;
  return values_of(*this).size() <= kMaxLabels ? lowest() + 1 : (lowest() + highest() + 1) / 2;
}

bool MaskValues::has_dark_labels() const {
  if (values_of(*this).size() > kMaxLabels) return false;
  const auto behind_lowest = pixels.begin() + lowest() + 1, usual = pixels.begin() + usual_threshold();
  if (behind_lowest >= usual) return false;
  const long dark = std::accumulate(behind_lowest, usual, 0L);
  return static_cast<double>(dark) > kLargePart * static_cast<double>(std::accumulate(behind_lowest, pixels.end(), 0L));
}

std::string MaskValues::to_string() const {
  const std::vector<int> values = values_of(*this);
  if (values.size() > kMaxNamedValues) return fmt::format("{} to {}", values.front(), values.back());
  return fmt::format("{}", fmt::join(values, ", "));
}

MaskValues look_at_masks(const std::string& source) {
  MaskValues found;
  for (const cv::Mat& mask : open_frames(source, PixelFormat::mask)->samples(kMasks))
    for (int y = 0; y < mask.rows; ++y)
      for (int x = 0; x < mask.cols; ++x) ++found.pixels[mask.at<unsigned char>(y, x)];
  return found;
}

}  // namespace doppel
