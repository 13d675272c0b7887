#pragma once

#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "doppel/detect/networks/network_options.h"

namespace doppel {

/// One output of a network.
struct NetworkOutput {
  std::string name;
  std::string last_operator;  ///< type of the layer that computes the output, as OpenCV calls it
  cv::Mat values;             ///< 32-bit float, all finite, continuous

  int dims() const { return values.dims; }
  int size(int dimension) const { return values.size[dimension]; }
  /// "[1, 17, 64, 48]"
  std::string shape() const;
};

/// The shapes of all outputs, for messages.
std::string shapes_of(const std::vector<NetworkOutput>& outputs);

/// A network in ONNX or Caffe format, run by OpenCV on the CPU. Not thread-safe.
class ImageNetwork {
 public:
  /// @throws FileError when the network cannot be read; UsageError for options out of range
  explicit ImageNetwork(const NetworkOptions& options);

  /// @param input [1, 3, h, w]
  /// @throws Error when the network cannot run on the input, lacks an output that the options name, or computes values
  /// that are not finite
  std::vector<NetworkOutput> run(const cv::Mat& input);

  const NetworkOptions& options() const { return options_; }
  /// The network's files, for messages.
  std::string files() const;

 private:
  void choose_outputs();
  std::string operator_of(int layer);

  NetworkOptions options_;
  cv::dnn::Net net_;
  std::vector<std::string> names_, operators_;  ///< of the outputs, in the order of use
};

}  // namespace doppel
