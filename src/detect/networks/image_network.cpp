#include "doppel/detect/networks/image_network.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core/utils/logger.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/detect/networks/onnx_edits.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// OpenCV's message without its file and line, on one line.
std::string reason_of(const std::exception& e) {
  const auto* const known = dynamic_cast<const cv::Exception*>(&e);
  std::string reason = known ? known->err : e.what();
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  return reason;
}

void check(const NetworkOptions& options) {
  if (options.input.empty() && (options.input_height < 8 || options.input_height > 4096))
    fail<UsageError>("the network's input height is {}; it must be 8 to 4096", options.input_height);
  if (!(options.threshold > 0.0))
    fail<UsageError>("the network's threshold is {}; it must be positive", options.threshold);
  for (const double deviation : options.deviation)
    if (!(deviation > 0.0) || !std::isfinite(deviation))
      fail<UsageError>("the network's deviation has the value {}; it must be positive", deviation);
}

cv::dnn::Net read_onnx(const fs::path& path) {
  const std::string bytes = readable_onnx(read_file(path));
  return cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
}

/// OpenCV prints an error before it throws one.
class QuietOpenCv {
 public:
  QuietOpenCv() : before_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(before_); }
  QuietOpenCv(const QuietOpenCv&) = delete;
  QuietOpenCv& operator=(const QuietOpenCv&) = delete;

 private:
  cv::utils::logging::LogLevel before_;
};

cv::dnn::Net read_net(const NetworkOptions& options, const std::string& files) {
  for (const fs::path& path : {options.model, options.weights})
    if (!path.empty() && !fs::is_regular_file(path)) fail_at({path.string(), 0}, "there is no such file");
  const std::string extension = options.model.extension().string();
  if (extension != ".onnx" && extension != ".prototxt")
    fail_at({options.model.string(), 0}, "is not a network that can be read; use .onnx or .prototxt");
  if ((extension == ".prototxt") == options.weights.empty())
    fail_at({options.model.string(), 0}, "a .prototxt needs its .caffemodel as `weights`, an .onnx needs no weights");
  const QuietOpenCv quiet;
  try {
    cv::dnn::Net net = extension == ".onnx"
                           ? read_onnx(options.model)
                           : cv::dnn::readNetFromCaffe(options.model.string(), options.weights.string());
    if (!net.empty()) return net;
  } catch (const std::exception& e) {
    fail_at({files, 0}, "OpenCV cannot read the network: {}", reason_of(e));
  }
  fail_at({files, 0}, "the network has no layers");
}

}  // namespace

std::string NetworkOutput::shape() const {
  return fmt::format("[{}]", fmt::join(values.size.p, values.size.p + values.dims, ", "));
}

std::string shapes_of(const std::vector<NetworkOutput>& outputs) {
  std::vector<std::string> texts;
  texts.reserve(outputs.size());
  for (const NetworkOutput& output : outputs) texts.push_back(fmt::format("{} {}", output.name, output.shape()));
  return fmt::format("{}", fmt::join(texts, ", "));
}

ImageNetwork::ImageNetwork(const NetworkOptions& options) : options_(options) {
  check(options);
  net_ = read_net(options, files());
  try {
    choose_outputs();
  } catch (const cv::Exception& e) {
    fail_at({files(), 0}, "OpenCV cannot read the network: {}", reason_of(e));
  }
}

std::string ImageNetwork::files() const {
  return options_.model.string() +
         (options_.weights.empty() ? "" : fmt::format(" with the weights {}", options_.weights.string()));
}

/// OpenCV ends each output of an ONNX file with a layer that only carries the output's name.
std::string ImageNetwork::operator_of(int layer) {
  const std::string type = net_.getLayer(layer)->type;
  if (type != "Identity") return type;
  const auto inputs = net_.getLayerInputs(layer);
  return inputs.empty() ? type : inputs[0]->type;
}

void ImageNetwork::choose_outputs() {
  const std::vector<std::string> found = net_.getUnconnectedOutLayersNames();
  const std::vector<int> layers = net_.getUnconnectedOutLayers();
  names_ = options_.outputs.empty() ? found : options_.outputs;
  for (const std::string& name : names_) {
    const auto entry = std::find(found.begin(), found.end(), name);
    if (entry == found.end())
      fail_at({files(), 0}, "has no output '{}', which `outputs` names; it has {}", name, fmt::join(found, ", "));
    operators_.push_back(operator_of(layers[entry - found.begin()]));
  }
}

std::vector<NetworkOutput> ImageNetwork::run(const cv::Mat& input) {
  std::vector<cv::Mat> values;
  try {
    net_.setInput(input);
    net_.forward(values, names_);
  } catch (const std::exception& e) {
    fail("{}: the network cannot run on an image of {}x{}: {}", files(), input.size[3], input.size[2], reason_of(e));
  }
  std::vector<NetworkOutput> outputs;
  for (std::size_t i = 0; i < values.size(); ++i) {
    NetworkOutput output{names_[i], operators_[i], {}};
    values[i].convertTo(output.values, CV_32F);
    if (!cv::checkRange(output.values.reshape(1, 1)))
      fail(
          "{}: the network's output '{}' has values that are not finite; check `mean` and `deviation`, and that the "
          "network was exported with 32-bit numbers",
          files(), names_[i]);
    outputs.push_back(std::move(output));
  }
  return outputs;
}

}  // namespace doppel
