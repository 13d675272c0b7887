#include "doppel/detect/blazepose/repeated_chroma.h"

#include <array>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace doppel {

namespace {

/// Whether the values in each block of 2 x 2 pixels are equal, or nearly so after the conversion of colours, while
/// those of neighbouring blocks differ. @param chroma [2] of an even size
bool is_repeated(const cv::Mat& chroma) {
  double within = 0, between = 0;
  for (int row = 0; row + 2 < chroma.rows; row += 2)
    for (int column = 0; column + 2 < chroma.cols; column += 2) {
      const cv::Vec2b &a = chroma.at<cv::Vec2b>(row, column), &b = chroma.at<cv::Vec2b>(row + 1, column + 1),
                      &c = chroma.at<cv::Vec2b>(row + 2, column + 2);
      for (int k = 0; k < 2; ++k) {
        within += std::abs(a[k] - b[k]);
        between += std::abs(b[k] - c[k]);
      }
    }
  return within < 0.2 * between;
}

}  // namespace

cv::Mat smooth_repeated_chroma(const cv::Mat& image) {
  const cv::Rect even(0, 0, image.cols / 2 * 2, image.rows / 2 * 2);
  if (even.width < 4 || even.height < 4) return image;
  std::array<cv::Mat, 2> parts;  // brightness and chroma
  cv::Mat converted;
  cv::cvtColor(image(even), converted, cv::COLOR_BGR2YCrCb);
  parts[0].create(even.size(), CV_8U);
  parts[1].create(even.size(), CV_8UC2);
  cv::mixChannels(&converted, 1, parts.data(), 2, std::array{0, 0, 1, 1, 2, 2}.data(), 3);
  if (!is_repeated(parts[1])) return image;
  cv::Mat half, result = image.clone();
  cv::resize(parts[1], half, even.size() / 2, 0, 0, cv::INTER_AREA);
  cv::resize(half, parts[1], even.size(), 0, 0, cv::INTER_LINEAR);
  cv::merge(parts.data(), parts.size(), converted);
  cv::cvtColor(converted, result(even), cv::COLOR_YCrCb2BGR);
  return result;
}

}  // namespace doppel
