#include "doppel/detect/blazepose/possible_parts.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/colour_product.h"
#include "doppel/detect/masks/components.h"

namespace doppel {
namespace {

constexpr double kReach = 0.4;           // of the person's longer side
constexpr float kMinDifference = 30.0f;  // levels of 255

cv::Mat disc(double radius) {
  const int side = 2 * std::max(1, static_cast<int>(std::lround(radius))) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
}

/// 255 where the colours differ.
cv::Mat differing(const cv::Mat& image, const StaticBackground& background) {
  cv::Mat result = cv::Mat::zeros(image.size(), CV_8U);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      if (background.known.at<std::uint8_t>(row, column) == 0) continue;
      const cv::Vec3f seen = image.at<cv::Vec3b>(row, column), learnt = background.colour.at<cv::Vec3b>(row, column);
      const cv::Vec3f change = seen - learnt;
      if (colour_product(change, change) >= kMinDifference * kMinDifference) result.at<std::uint8_t>(row, column) = 255;
    }
  return result;
}

}  // namespace

void mark_possible_parts(const cv::Mat& image, cv::Mat& mask, const StaticBackground& background) {
  if (image.type() != CV_8UC3 || mask.type() != CV_8U || image.size() != mask.size())
    fail<UsageError>(
        "marking possible parts of a mask: the image has {}x{} pixels and {} channels, the mask {}x{} and {}; expected "
        "an 8-bit colour image and an 8-bit mask of one channel and the same size",
        image.cols, image.rows, image.channels(), mask.cols, mask.rows, mask.channels());
  const cv::Rect person = cv::boundingRect(mask);
  if (person.empty() || background.known.size() != image.size()) return;
  const auto reach = static_cast<int>(std::lround(kReach * std::max(person.width, person.height)));
  const cv::Point around(reach, reach);
  const cv::Rect box = cv::Rect(person.tl() - around, person.br() + around) & cv::Rect({}, image.size());
  const double cell = mask_cell(mask);

  cv::Mat inside = mask(box);
  cv::Mat parts = differing(image(box), {background.colour(box), background.known(box)}) & ~inside;
  cv::Mat wide, near_wide, beside;
  cv::morphologyEx(parts, wide, cv::MORPH_OPEN, disc(cell));
  cv::dilate(wide, near_wide, disc(2.0 * cell));
  cv::dilate(inside, beside, disc(1.0));
  inside.setTo(kPossiblePerson, components_touching(parts & near_wide, beside));
}

}  // namespace doppel
