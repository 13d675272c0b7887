#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace doppel {

/// Sizes of a tensor, in the order of the file: images are [1, height, width, channels].
using TensorShape = std::vector<std::int64_t>;
/// The product of the sizes.
std::int64_t num_elements(const TensorShape& shape);
/// "1x256x256x3".
std::string to_string(const TensorShape& shape);

/// What an operator computes. The names are those of the file format.
enum class NetworkOp {
  add,
  concatenation,
  conv_2d,
  depthwise_conv_2d,
  depth_to_space,
  fully_connected,
  logistic,
  max_pool_2d,
  mean,
  pad,
  prelu,
  reshape,
  resize_bilinear
};
/// All operators by name.
const std::map<std::string, NetworkOp>& network_operators();
std::string to_string(NetworkOp op);

/// A tensor of a network: a constant, or one that is computed.
struct NetworkTensor {
  std::string name;
  TensorShape shape;
  std::shared_ptr<const std::vector<float>> values;  ///< of a constant, [num_elements]; null: computed
};

/// One step of a network.
struct NetworkOperator {
  NetworkOp op = NetworkOp::add;
  std::vector<int> inputs;  ///< tensors; with weights: the values, the weights and the bias
  int output = 0;
  /// Convolutions and pooling: the step from window to window, and whether the windows begin outside of the image, such
  /// that the output has ceil(size / stride) pixels; otherwise all windows lie inside.
  int stride_x = 1, stride_y = 1;
  bool same_padding = false;
  int window_width = 1, window_height = 1;  ///< of pooling
  /// The fused activation: results are clamped to this range. RELU6 is [0, 6].
  float least = -std::numeric_limits<float>::infinity(), most = std::numeric_limits<float>::infinity();
  int axis = 0;                                     ///< of a concatenation
  int block_size = 0;                               ///< of depth_to_space
  std::vector<std::int64_t> pad_before, pad_after;  ///< zeros before and after each axis
};

/// A network as a list of operators in the order of execution.
/// - conv_2d: weights [outputs, height, width, inputs], bias [outputs].
/// - depthwise_conv_2d: weights [1, height, width, channels], bias [channels]; one filter for each channel.
/// - fully_connected: values [n, inputs], weights [outputs, inputs], bias [outputs].
/// - prelu: the values, and factors [1, 1, channels] by which negative values are multiplied.
/// - mean: over the rows and columns of an image, [n, channels] or [n, 1, 1, channels].
/// - resize_bilinear: pixel centres are at +0.5, and pixels beyond the border repeat it.
/// - depth_to_space: the channels of a pixel are (row in the block, column in the block, output channel).
struct NetworkModel {
  std::string source;  ///< the file, for messages
  std::vector<NetworkTensor> tensors;
  std::vector<NetworkOperator> operators;
  std::vector<int> inputs, outputs;
};

}  // namespace doppel
