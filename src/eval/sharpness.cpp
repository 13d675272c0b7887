#include "doppel/eval/sharpness.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel {

double detail_energy(const cv::Mat& rgb, const cv::Mat& region) {
  const int pixels = cv::countNonZero(region);
  if (pixels == 0) return 0.0;
  // The Gaussian's response exp(-2 (pi sigma f)^2) at the limit is 1 - 1/sqrt(2): half of the energy remains above.
  const double sigma = std::sqrt(-std::log(1.0 - std::sqrt(0.5)) / 2.0) / (CV_PI * kDetailFrequency);
  cv::Mat grey, inside, mean, share;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  grey.convertTo(grey, CV_32F);
  cv::Mat(region != 0).convertTo(inside, CV_32F, 1.0 / 255.0);
  cv::GaussianBlur(grey.mul(inside), mean, {}, sigma, sigma, cv::BORDER_CONSTANT);
  cv::GaussianBlur(inside, share, {}, sigma, sigma, cv::BORDER_CONSTANT);
  const cv::Mat detail = (grey - mean / cv::max(share, 1e-6F)).mul(inside);
  return cv::norm(detail, cv::NORM_L2SQR) / pixels;
}

}  // namespace doppel
