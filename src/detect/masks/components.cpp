#include "doppel/detect/masks/components.h"

#include <algorithm>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace doppel {
namespace {

constexpr int kFlooded = 128;

/// Paints the component of a pixel with kFlooded. @return its number of pixels
int flood(cv::Mat& mask, const cv::Point& pixel, int connectivity) {
  return cv::floodFill(mask, pixel, cv::Scalar(kFlooded), nullptr, {}, {}, connectivity);
}

/// A pixel of the mask, from the middle of the image outwards; (-1, -1) in an empty mask.
cv::Point pixel_near_middle(const cv::Mat& mask) {
  for (int i = 0; i < mask.rows; ++i) {
    const int row = mask.rows / 2 + (i % 2 == 0 ? i / 2 : -(i + 1) / 2);
    const auto *begin = mask.ptr(row), *end = begin + mask.cols;
    const auto* found = std::find(begin, end, 255);
    if (found != end) return {static_cast<int>(found - begin), row};
  }
  return {-1, -1};
}

}  // namespace

// One component with more than half of the pixels is the largest. Flooding it takes a fraction of the time of labelling
// all of them.
cv::Mat largest_component(const cv::Mat& mask) {
  const cv::Point seed = pixel_near_middle(mask);
  if (seed.x < 0) return cv::Mat::zeros(mask.size(), CV_8U);
  cv::Mat flooded = mask.clone();
  if (2 * flood(flooded, seed, 8) > cv::countNonZero(mask)) return flooded == kFlooded;
  cv::Mat labels, statistics, centroids;
  const int count = cv::connectedComponentsWithStats(mask, labels, statistics, centroids, 8, CV_32S);
  int best = 1;
  for (int label = 2; label < count; ++label)
    if (statistics.at<int>(label, cv::CC_STAT_AREA) > statistics.at<int>(best, cv::CC_STAT_AREA)) best = label;
  return labels == best;
}

cv::Mat components_touching(const cv::Mat& mask, const cv::Mat& other) {
  cv::Mat labels;
  const int count = cv::connectedComponents(mask, labels, 8, CV_32S);
  std::vector<bool> touches(count, false);
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column)
      if (other.at<std::uint8_t>(row, column) != 0) touches[labels.at<int>(row, column)] = true;
  cv::Mat result = cv::Mat::zeros(mask.size(), CV_8U);
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column)
      if (const int label = labels.at<int>(row, column); label != 0 && touches[label])
        result.at<std::uint8_t>(row, column) = 255;
  return result;
}

// The background at the corners is flooded first: often there is no other component.
void fill_holes(cv::Mat& mask, int largest) {
  if (mask.empty()) return;
  cv::Mat rest = ~mask;
  for (const cv::Point corner : {cv::Point(0, 0), cv::Point(mask.cols - 1, 0), cv::Point(0, mask.rows - 1),
                                 cv::Point(mask.cols - 1, mask.rows - 1)}) {
    if (rest.at<std::uint8_t>(corner) != 255) continue;
    cv::Mat flooded = rest.clone();
    if (flood(flooded, corner, 4) > largest) rest = flooded == 255;
  }
  const cv::Rect box = cv::boundingRect(rest);
  if (box.empty()) return;
  cv::Mat labels, statistics, centroids;
  const int count = cv::connectedComponentsWithStats(rest(box), labels, statistics, centroids, 4, CV_32S);
  for (int label = 1; label < count; ++label)
    if (statistics.at<int>(label, cv::CC_STAT_AREA) <= largest) mask(box).setTo(255, labels == label);
}

}  // namespace doppel
