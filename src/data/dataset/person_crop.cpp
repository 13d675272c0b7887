#include "doppel/data/dataset/person_crop.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr double kMaskReach = 0.1, kJitter = 0.05, kColourRange = 0.2, kHueRange = 0.05;
constexpr int kMinPoints = 4;
constexpr double kCoarse = 1.5;  ///< source pixels per pixel; above this, images are downsampled by averaging first
constexpr double kLuma[3]{0.299, 0.587, 0.114};

/// Whether a point counts for the window.
bool counts(const Keypoint& point, const cv::Rect2d& mask_box) {
  if (point.confidence < kSeenConfidence) return false;
  if (mask_box.area() <= 0.0) return true;
  const double reach = kMaskReach * std::max(mask_box.width, mask_box.height);
  return point.x >= mask_box.x - reach && point.x <= mask_box.br().x + reach && point.y >= mask_box.y - reach &&
         point.y <= mask_box.br().y + reach;
}

/// The part of an image in a window: 8-bit, any number of channels.
cv::Mat cut_window(const cv::Mat& image, const PersonImage& person, const PersonWindow& window, int pixels) {
  const double step = window.side / pixels * person.scale;  // pixels of the image per pixel of the result
  cv::Mat source = image;
  double sx = 1.0, sy = 1.0;
  if (step > kCoarse) {
    const cv::Size size(std::max(1, cvRound(image.cols / step)), std::max(1, cvRound(image.rows / step)));
    cv::resize(image, source, size, 0.0, 0.0, cv::INTER_AREA);
    sx = static_cast<double>(size.width) / image.cols;
    sy = static_cast<double>(size.height) / image.rows;
  }
  // In OpenCV's coordinates, with pixel centres at integers.
  const auto start = [&](double from, double origin, double s) {
    return s * (person.scale * (from - origin) + 0.5 * step) - 0.5;
  };
  const cv::Matx23d source_from_result(sx * step, 0.0, start(window.u0, person.u0, sx), 0.0, sy * step,
                                       start(window.v0, person.v0, sy));
  cv::Mat result;
  cv::warpAffine(source, result, source_from_result, {pixels, pixels}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_CONSTANT);
  return result;
}

/// The linear part of a change of colours, RGB to RGB.
cv::Matx33d colour_matrix(const Photometry& change) {
  const double c = std::cos(change.hue), s = std::sin(change.hue);
  const double same = c + (1.0 - c) / 3.0, next = (1.0 - c) / 3.0 - s / std::sqrt(3.0),
               other = (1.0 - c) / 3.0 + s / std::sqrt(3.0);
  const cv::Matx33d hue(same, next, other, other, same, next, next, other, same);
  cv::Matx33d saturation = change.saturation * cv::Matx33d::eye();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) saturation(row, column) += (1.0 - change.saturation) * kLuma[column];
  return change.contrast * change.brightness * (hue * saturation);
}

/// Mean brightness of the person, 0..255. @param rgb black outside the person
double mean_luma(const cv::Mat& rgb, const cv::Mat& alpha) {
  const cv::Scalar sum = cv::sum(rgb);
  const double weight = cv::sum(alpha)[0] / 255.0;
  return weight > 0.0 ? (kLuma[0] * sum[0] + kLuma[1] * sum[1] + kLuma[2] * sum[2]) / weight : 0.0;
}

}  // namespace

PinholeCamera PersonWindow::camera(const PinholeCamera& camera, int pixels) const {
  return camera.cropped(u0, v0, pixels / side, pixels, pixels);
}

PersonWindow person_window(const std::vector<Keypoint>& keypoints, const cv::Rect2d& mask_box) {
  cv::Rect2d box = mask_box;
  int found = 0;
  double left = HUGE_VAL, top = HUGE_VAL, right = -HUGE_VAL, bottom = -HUGE_VAL;
  for (const Keypoint& point : keypoints) {
    if (!counts(point, mask_box)) continue;
    ++found;
    left = std::min<double>(left, point.x);
    right = std::max<double>(right, point.x);
    top = std::min<double>(top, point.y);
    bottom = std::max<double>(bottom, point.y);
  }
  if (found >= kMinPoints) box = cv::Rect2d(left, top, right - left, bottom - top);
  const double longer = std::max(box.width, box.height);
  if (!(longer > 0.0)) return {};
  const double side = (1.0 + 2.0 * kPersonMargin) * longer;
  return {box.x + 0.5 * (box.width - side), box.y + 0.5 * (box.height - side), side};
}

Photometry draw_photometry(SplitMix& random) {
  const auto factor = [&] { return random.uniform(1.0 - kColourRange, 1.0 + kColourRange); };
  Photometry change;
  change.brightness = factor();
  change.contrast = factor();
  change.saturation = factor();
  change.hue = 2.0 * CV_PI * random.uniform(-kHueRange, kHueRange);
  return change;
}

PersonWindow draw_window(const PersonWindow& window, SplitMix& random) {
  const double side = window.side * random.uniform(1.0 - kJitter, 1.0 + kJitter);
  const double du = window.side * random.uniform(-kJitter, kJitter);
  const double dv = window.side * random.uniform(-kJitter, kJitter);
  return {window.u0 + 0.5 * (window.side - side) + du, window.v0 + 0.5 * (window.side - side) + dv, side};
}

cv::Rect2d PersonImage::mask_box() const {
  const cv::Rect box = cv::boundingRect(foreground);
  if (box.area() == 0) return {};
  return {u0 + box.x / scale, v0 + box.y / scale, box.width / scale, box.height / scale};
}

void write_person(const PersonImage& image, const PersonWindow& window, const Photometry& photometry, int pixels,
                  float* to) {
  // The background is removed before averaging. Otherwise its colour would remain along the outline of the person.
  const cv::Mat solid = image.foreground != 0;
  cv::Mat person = cv::Mat::zeros(image.rgb.size(), CV_8UC3);
  image.rgb.copyTo(person, solid);
  const cv::Mat rgb = cut_window(person, image, window, pixels), alpha = cut_window(solid, image, window, pixels);

  const cv::Matx33d matrix = colour_matrix(photometry);
  const double offset = (1.0 - photometry.contrast) * photometry.brightness * mean_luma(rgb, alpha);
  const std::size_t area = as_size(pixels) * pixels;
  for (int row = 0; row < pixels; ++row) {
    const cv::Vec3b* from = rgb.ptr<cv::Vec3b>(row);
    const std::uint8_t* cover = alpha.ptr<std::uint8_t>(row);
    for (int column = 0; column < pixels; ++column)
      for (int k = 0; k < 3; ++k) {
        double value = offset * cover[column] / 255.0;
        for (int c = 0; c < 3; ++c) value += matrix(k, c) * from[column][c];
        const auto colour = static_cast<float>(std::clamp(value / 255.0, 0.0, 1.0));
        to[k * area + as_size(row) * pixels + column] = (colour - kInputMean[k]) / kInputDeviation[k];
      }
  }
}

PersonInput person_input(const cv::Mat& bgr, const cv::Mat& mask, const std::vector<Keypoint>& keypoints,
                         const PinholeCamera& camera, int pixels) {
  if (bgr.size() != mask.size())
    fail<UsageError>("the image is {}x{}, its mask {}x{}; they must be equal", bgr.cols, bgr.rows, mask.cols,
                     mask.rows);
  PersonImage image;
  cv::cvtColor(bgr, image.rgb, cv::COLOR_BGR2RGB);
  image.foreground = mask;
  const cv::Rect2d box = image.mask_box();
  PersonInput input;
  input.valid = box.area() > 0.0;
  const PersonWindow window = input.valid
                                  ? person_window(keypoints, box)
                                  : PersonWindow{0.0, 0.0, static_cast<double>(std::max(camera.width, camera.height))};
  input.camera = input.valid ? window.camera(camera, pixels) : camera;
  input.image = torch::empty({3, pixels, pixels}, torch::kFloat32);
  write_person(image, window, {}, pixels, input.image.data_ptr<float>());
  return input;
}

}  // namespace doppel
