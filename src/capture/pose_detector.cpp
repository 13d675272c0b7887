#include "doppel/capture/pose_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kStride = 8;  ///< of this family of networks: other input sizes would shift the heatmaps

/// The network's files, for messages.
std::string files_of(const PoseDetectorOptions& options) {
  return options.model.string() +
         (options.weights.empty() ? "" : fmt::format(" with the weights {}", options.weights.string()));
}

/// OpenCV's message without its file and line.
std::string reason_of(const std::exception& e) {
  const auto* const known = dynamic_cast<const cv::Exception*>(&e);
  return known ? known->err : e.what();
}

cv::dnn::Net read_net(const PoseDetectorOptions& options) {
  for (const fs::path& path : {options.model, options.weights})
    if (!path.empty() && !fs::is_regular_file(path)) fail_at({path.string(), 0}, "there is no such file");
  const std::string extension = options.model.extension().string();
  if (extension != ".onnx" && extension != ".prototxt")
    fail_at({options.model.string(), 0}, "is not a network that can be read; use .onnx or .prototxt");
  if ((extension == ".prototxt") == options.weights.empty())
    fail_at({options.model.string(), 0}, "a .prototxt needs its .caffemodel as `weights`, an .onnx needs no weights");
  try {
    cv::dnn::Net net = extension == ".onnx"
                           ? cv::dnn::readNetFromONNX(options.model.string())
                           : cv::dnn::readNetFromCaffe(options.model.string(), options.weights.string());
    if (!net.empty()) return net;
  } catch (const std::exception& e) {
    fail_at({files_of(options), 0}, "OpenCV cannot read the network: {}", reason_of(e));
  }
  fail_at({files_of(options), 0}, "the network has no layers");
}

/// The position of the maximum of a parabola through three neighbours, -0.5 to 0.5.
double peak(double before, double middle, double after) {
  const double curvature = before - 2.0 * middle + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

/// The largest value of a heatmap and its position, in pixels of the heatmap. @param heatmap 32-bit float
Keypoint find_peak(const cv::Mat& heatmap, double threshold) {
  double value = 0.0;
  cv::Point at;
  cv::minMaxLoc(heatmap, nullptr, &value, nullptr, &at);
  if (!(value >= threshold) || !std::isfinite(value)) return {};
  const auto row = [&](int y) { return heatmap.at<float>(std::clamp(y, 0, heatmap.rows - 1), at.x); };
  const auto column = [&](int x) { return heatmap.at<float>(at.y, std::clamp(x, 0, heatmap.cols - 1)); };
  const double x = at.x + 0.5 + peak(column(at.x - 1), value, column(at.x + 1));
  const double y = at.y + 0.5 + peak(row(at.y - 1), value, row(at.y + 1));
  if (!std::isfinite(x) || !std::isfinite(y)) return {};
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(std::min(value, 1.0))};
}

}  // namespace

struct PoseDetector::Impl {
  PoseDetectorOptions options;
  PointLayout layout;
  cv::dnn::Net net;

  cv::Mat run(const cv::Mat& image) {
    const auto stepped = [](double pixels) { return std::max(1, cvRound(pixels / kStride)) * kStride; };
    const cv::Size size(stepped(static_cast<double>(options.input_height) * image.cols / image.rows),
                        stepped(options.input_height));
    // Downsampled by area averaging; blobFromImage would pick single pixels.
    cv::Mat resized;
    cv::resize(image, resized, size, 0.0, 0.0, size.height < image.rows ? cv::INTER_AREA : cv::INTER_LINEAR);
    const cv::Scalar mean(options.mean[0], options.mean[1], options.mean[2]);
    try {
      net.setInput(cv::dnn::blobFromImage(resized, options.scale, size, mean, options.rgb, false));
      return net.forward();
    } catch (const std::exception& e) {
      fail("{}: the network cannot run on an image of {}x{}: {}", files_of(options), size.width, size.height,
           reason_of(e));
    }
  }
};

PoseDetector::PoseDetector(const PoseDetectorOptions& options, const PointLayout& layout)
    : impl_(std::make_unique<Impl>()) {
  if (options.input_height < kStride || options.input_height > 4096)
    fail<UsageError>("the detector's input height is {}; it must be {} to 4096", options.input_height, kStride);
  if (!(options.threshold > 0.0))
    fail<UsageError>("the detector's threshold is {}; it must be positive", options.threshold);
  if (options.mean.size() != 3)
    fail<UsageError>("the detector's mean has {} numbers; three are needed", options.mean.size());
  impl_->options = options;
  impl_->layout = layout;
  impl_->net = read_net(options);
}

PoseDetector::~PoseDetector() = default;
PoseDetector::PoseDetector(PoseDetector&&) noexcept = default;
PoseDetector& PoseDetector::operator=(PoseDetector&&) noexcept = default;

People PoseDetector::detect(const cv::Mat& image) {
  const cv::Mat output = impl_->run(image);
  const int points = static_cast<int>(impl_->layout.points.size());
  if (output.dims != 4 || output.size[0] != 1 || output.size[1] < points || output.type() != CV_32F)
    fail(
        "{}: the network's output must be heatmaps, [1, at least {}, height, width] for the points of '{}'; it has {} "
        "dimensions and {} channels",
        files_of(impl_->options), points, impl_->layout.name, output.dims, output.dims > 1 ? output.size[1] : 0);
  Person person;
  bool seen = false;
  for (int i = 0; i < points; ++i) {
    const cv::Mat heatmap(output.size[2], output.size[3], CV_32F, const_cast<float*>(output.ptr<float>(0, i)));
    Keypoint point = find_peak(heatmap, impl_->options.threshold);
    point.x *= static_cast<float>(image.cols) / static_cast<float>(heatmap.cols);
    point.y *= static_cast<float>(image.rows) / static_cast<float>(heatmap.rows);
    seen |= point.confidence > 0.0f;
    person.push_back(point);
  }
  return seen ? People{person} : People();
}

}  // namespace doppel
