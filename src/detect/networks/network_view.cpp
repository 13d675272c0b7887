#include "doppel/detect/networks/network_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

constexpr int kStride = 8;  ///< of networks for images of any size: other sizes would shift their heatmaps

Eigen::Vector2d vector_of(cv::Size size) { return {size.width, size.height}; }

/// OpenCV's transform, between pixel centres at whole numbers, of x -> origin + step * x between centres at +0.5.
cv::Matx23d between_centres(const Eigen::Vector2d& origin, const Eigen::Vector2d& step) {
  const Eigen::Vector2d shift = origin + 0.5 * step - Eigen::Vector2d(0.5, 0.5);
  return {step.x(), 0.0, shift.x(), 0.0, step.y(), shift.y()};
}

cv::Mat resized(const cv::Mat& image, cv::Size size) {
  cv::Mat result;
  cv::resize(image, result, size, 0.0, 0.0, size.height < image.rows ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

/// The pixels of the image in the view and one around it.
cv::Rect window_of(const NetworkView& view, cv::Size image) {
  const Eigen::Vector2d end = view.image_from_input(vector_of(view.input));
  const auto low = [](double value, int most) { return static_cast<int>(std::clamp(value, 0.0, double(most))); };
  const int x = low(std::floor(view.origin.x()) - 1, image.width),
            y = low(std::floor(view.origin.y()) - 1, image.height);
  return {x, y, low(std::ceil(end.x()) + 1, image.width) - x, low(std::ceil(end.y()) + 1, image.height) - y};
}

/// The colours of a view, 8-bit BGR.
cv::Mat sample_view(const cv::Mat& image, const NetworkView& view, double border) {
  const cv::Mat empty(view.input, CV_8UC3, cv::Scalar::all(border));
  const cv::Rect window = window_of(view, image.size());
  if (window.empty()) return empty;
  cv::Mat source = image(window);
  Eigen::Vector2d origin = view.origin - Eigen::Vector2d(window.x, window.y), step = view.step;
  // Many pixels for one are averaged first: interpolation would pick single ones.
  const auto shrink = [](double pixels, double by) { return std::max(1, static_cast<int>(pixels / std::floor(by))); };
  if (step.minCoeff() >= 2.0) {
    const Eigen::Vector2d before = vector_of(source.size());
    source = resized(source, {shrink(before.x(), step.x()), shrink(before.y(), step.y())});
    const Eigen::Vector2d scale = vector_of(source.size()).cwiseQuotient(before);
    origin = origin.cwiseProduct(scale);
    step = step.cwiseProduct(scale);
  }
  cv::Mat result;
  cv::warpAffine(source, result, between_centres(origin, step), view.input, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_CONSTANT, cv::Scalar::all(border));
  return result;
}

bool shows_exactly(const NetworkView& view, cv::Size image) {
  return view.origin.isZero() &&
         (view.image_from_input(vector_of(view.input)) - vector_of(image)).cwiseAbs().maxCoeff() < 1e-9;
}

}  // namespace

cv::Size input_size(const NetworkOptions& options, cv::Size image) {
  if (!options.input.empty()) return options.input;
  const auto stepped = [](double pixels) { return std::max(1, cvRound(pixels / kStride)) * kStride; };
  return {stepped(static_cast<double>(options.input_height) * image.width / image.height),
          stepped(options.input_height)};
}

NetworkView whole_view(const NetworkOptions& options, cv::Size image) {
  const cv::Size input = input_size(options, image);
  const PersonBox all{Eigen::Vector2d::Zero(), vector_of(image)};
  if (options.letterbox) return crop_view(all, 1.0, input);
  return {input, Eigen::Vector2d::Zero(), vector_of(image).cwiseQuotient(vector_of(input))};
}

NetworkView crop_view(const PersonBox& box, double padding, cv::Size input) {
  const Eigen::Vector2d pixels = vector_of(input);
  const double step = std::max(1e-6, padding * box.size().cwiseQuotient(pixels).maxCoeff());
  return {input, box.centre() - 0.5 * step * pixels, {step, step}};
}

cv::Mat network_input(const cv::Mat& image, const NetworkView& view, const NetworkOptions& options) {
  const cv::Mat colours =
      shows_exactly(view, image.size()) ? resized(image, view.input) : sample_view(image, view, options.border);
  const int shape[] = {1, 3, view.input.height, view.input.width};
  cv::Mat blob(4, shape, CV_32F);
  for (int channel = 0; channel < 3; ++channel) {
    const auto index = as_size(channel);
    cv::Mat plane;
    cv::extractChannel(colours, plane, options.rgb ? 2 - channel : channel);
    cv::Mat values(view.input, CV_32F, blob.ptr<float>(0, channel));
    plane.convertTo(values, CV_32F, 1.0 / options.deviation[index], -options.mean[index] / options.deviation[index]);
  }
  return blob;
}

cv::Mat image_mask(const cv::Mat& probability, const NetworkView& view, cv::Size image) {
  cv::Mat result(image, CV_8U, cv::Scalar(0));
  // The pixels whose centres are in the view.
  const Eigen::Vector2d size = vector_of(view.input), end = view.image_from_input(size);
  const auto first = [](double edge, int most) {
    return static_cast<int>(std::clamp(std::ceil(edge - 0.5), 0.0, double(most)));
  };
  const cv::Rect seen(cv::Point(first(view.origin.x(), image.width), first(view.origin.y(), image.height)),
                      cv::Point(first(end.x(), image.width), first(end.y(), image.height)));
  if (seen.empty()) return result;
  // mask position = (pixel - origin) / step * (mask size / input size)
  const Eigen::Vector2d entries = vector_of(probability.size()).cwiseQuotient(size).cwiseQuotient(view.step);
  const Eigen::Vector2d origin = (Eigen::Vector2d(seen.x, seen.y) - view.origin).cwiseProduct(entries);
  cv::Mat values;
  cv::warpAffine(probability, values, between_centres(origin, entries), seen.size(),
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  values.convertTo(result(seen), CV_8U, 255.0);
  return result;
}

}  // namespace doppel
