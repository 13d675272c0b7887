#include "doppel/detect/blazepose/network_shapes.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr std::int64_t kMaxPadding = 1 << 20;

/// Number of windows along one axis; 0 when none fits.
std::int64_t num_windows(std::int64_t size, std::int64_t window, std::int64_t stride, bool same) {
  if (same) return (size + stride - 1) / stride;
  return size < window ? 0 : (size - window) / stride + 1;
}

/// Checks one operator after the other; messages name it.
class ShapeCheck {
 public:
  explicit ShapeCheck(const NetworkModel& model) : model_(model), known_(model.tensors.size(), false) {
    for (std::size_t i = 0; i < known_.size(); ++i) known_[i] = model.tensors[i].values != nullptr;
  }

  void run() {
    for (const int input : model_.inputs) {
      if (known_[input])
        fail_at({model_.source, 0}, "the network's input {} is a constant, or an input twice", name(input));
      known_[input] = true;
    }
    for (number_ = 0; number_ < model_.operators.size(); ++number_) check(model_.operators[number_]);
    check_outputs();
    check_uses();
  }

 private:
  const std::string& name(int tensor) const { return model_.tensors[tensor].name; }

  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    const NetworkOperator& step = model_.operators[number_];
    fail_at({model_.source, 0}, "operator {}, {}, which computes {}: {}", number_, to_string(step.op),
            name(step.output), fmt::format(format, std::forward<Args>(args)...));
  }

  const TensorShape& shape_of(int tensor) const { return model_.tensors[tensor].shape; }

  void check(const NetworkOperator& step) {
    for (const int input : step.inputs) {
      if (!known_[input]) fail_here("its input {} is not computed before", name(input));
    }
    if (known_[step.output]) fail_here("this tensor is a constant, an input or computed before");
    const TensorShape expected = output_shape(step);
    if (shape_of(step.output) != expected)
      fail_here("the file says {}, but its inputs give {}", to_string(shape_of(step.output)), to_string(expected));
    known_[step.output] = true;
  }

  void check_outputs() const {
    std::vector<bool> results(known_.size(), false);
    for (const NetworkOperator& step : model_.operators) results[step.output] = true;
    for (const int output : model_.outputs) {
      if (!results[output])
        fail_at({model_.source, 0}, "the network's output {} is not computed by any operator, or an output twice",
                name(output));
      results[output] = false;
    }
  }

  /// A file with a result that nothing uses is damaged.
  void check_uses() const {
    std::vector<bool> used(known_.size(), false);
    for (const int output : model_.outputs) used[output] = true;
    for (const NetworkOperator& step : model_.operators) {
      for (const int input : step.inputs) used[input] = true;
    }
    std::vector<int> computed = model_.inputs;
    for (const NetworkOperator& step : model_.operators) computed.push_back(step.output);
    for (const int tensor : computed) {
      if (!used[tensor]) fail_at({model_.source, 0}, "the network does not use the tensor {}", name(tensor));
    }
  }

  void require_inputs(const NetworkOperator& step, std::size_t count) const {
    if (step.inputs.size() != count) fail_here("has {} inputs, expected {}", step.inputs.size(), count);
  }

  /// The shape of the first input, [n, height, width, channels].
  const TensorShape& image_shape(const NetworkOperator& step) const {
    const TensorShape& shape = shape_of(step.inputs[0]);
    if (shape.size() != 4) fail_here("its input is {}, expected four axes", to_string(shape));
    return shape;
  }

  TensorShape output_shape(const NetworkOperator& step) const {
    switch (step.op) {
      case NetworkOp::add:
        return shape_of_sum(step);
      case NetworkOp::concatenation:
        return shape_of_concatenation(step);
      case NetworkOp::conv_2d:
      case NetworkOp::depthwise_conv_2d:
        return shape_of_convolution(step);
      case NetworkOp::depth_to_space:
        return shape_of_blocks(step);
      case NetworkOp::fully_connected:
        return shape_of_product(step);
      case NetworkOp::max_pool_2d:
        return shape_of_pooling(step);
      case NetworkOp::mean:
        return shape_of_mean(step);
      case NetworkOp::pad:
        return shape_of_padding(step);
      case NetworkOp::prelu:
        return shape_of_prelu(step);
      case NetworkOp::resize_bilinear:
        return shape_of_resize(step);
      case NetworkOp::reshape:
        return shape_of_reshape(step);
      case NetworkOp::logistic:
        break;
    }
    require_inputs(step, 1);
    return shape_of(step.inputs[0]);
  }

  TensorShape shape_of_sum(const NetworkOperator& step) const {
    require_inputs(step, 2);
    const TensorShape &a = shape_of(step.inputs[0]), &b = shape_of(step.inputs[1]);
    if (a != b) fail_here("its inputs are {} and {}, expected equal shapes", to_string(a), to_string(b));
    return a;
  }

  TensorShape shape_of_concatenation(const NetworkOperator& step) const {
    TensorShape sum = shape_of(step.inputs[0]);
    if (step.axis < 0 || as_size(step.axis) >= sum.size()) fail_here("its input has no axis {}", step.axis);
    for (std::size_t i = 1; i < step.inputs.size(); ++i) {
      TensorShape next = shape_of(step.inputs[i]);
      const bool same_axes = next.size() == sum.size();
      if (same_axes) std::swap(next[step.axis], sum[step.axis]);
      const std::int64_t size = same_axes ? sum[step.axis] : 0;
      if (same_axes) sum[step.axis] = next[step.axis];
      if (next != sum) fail_here("its input {} is {}", name(step.inputs[i]), to_string(shape_of(step.inputs[i])));
      sum[step.axis] += size;
    }
    return sum;
  }

  TensorShape windows_of(const NetworkOperator& step, std::int64_t height, std::int64_t width,
                         std::int64_t channels) const {
    image_shape(step);
    const TensorShape image = padded_shape(step);
    const std::int64_t rows = num_windows(image[1], height, step.stride_y, step.same_padding),
                       columns = num_windows(image[2], width, step.stride_x, step.same_padding);
    if (rows == 0 || columns == 0)
      fail_here("its window of {}x{} does not fit into its input, {}", width, height, to_string(image));
    return {image[0], rows, columns, channels};
  }

  void require_constant(int tensor) const {
    if (model_.tensors[tensor].values == nullptr) fail_here("its input {} is no constant", name(tensor));
  }

  /// Of an operator with weights.
  void require_weights(const NetworkOperator& step) const {
    require_inputs(step, 3);
    for (const int constant : {step.inputs[1], step.inputs[2]}) require_constant(constant);
  }

  TensorShape shape_of_product(const NetworkOperator& step) const {
    require_weights(step);
    const TensorShape &values = shape_of(step.inputs[0]), &weights = shape_of(step.inputs[1]);
    if (values.size() != 2 || weights.size() != 2 || values[1] != weights[1])
      fail_here("its input is {} and its weights are {}, expected two axes and equal last ones", to_string(values),
                to_string(weights));
    if (shape_of(step.inputs[2]) != TensorShape{weights[0]})
      fail_here("its bias is {} for {} outputs", to_string(shape_of(step.inputs[2])), weights[0]);
    return {values[0], weights[0]};
  }

  TensorShape shape_of_mean(const NetworkOperator& step) const {
    require_inputs(step, 1);
    const TensorShape& image = image_shape(step);
    if (shape_of(step.output).size() == 4) return {image[0], 1, 1, image[3]};
    return {image[0], image[3]};
  }

  TensorShape shape_of_convolution(const NetworkOperator& step) const {
    require_weights(step);
    const bool depthwise = step.op == NetworkOp::depthwise_conv_2d;
    const std::int64_t channels = image_shape(step)[3];
    const TensorShape &weights = shape_of(step.inputs[1]), &bias = shape_of(step.inputs[2]);
    const bool fits = weights.size() == 4 && weights[3] == channels && (!depthwise || weights[0] == 1);
    if (!fits) fail_here("its weights are {} for {} channels", to_string(weights), channels);
    const std::int64_t outputs = depthwise ? channels : weights[0];
    if (bias != TensorShape{outputs}) fail_here("its bias is {} for {} channels", to_string(bias), outputs);
    return windows_of(step, weights[1], weights[2], outputs);
  }

  TensorShape shape_of_pooling(const NetworkOperator& step) const {
    require_inputs(step, 1);
    const bool large = step.window_width * step.window_height > 1;
    if (step.window_width < 1 || step.window_height < 1 || step.window_width > 1024 || step.window_height > 1024 ||
        !large)
      fail_here("has windows of {}x{}, expected 2 pixels or more and sides of 1 to 1024", step.window_width,
                step.window_height);
    return windows_of(step, step.window_height, step.window_width, image_shape(step)[3]);
  }

  TensorShape shape_of_blocks(const NetworkOperator& step) const {
    require_inputs(step, 1);
    const TensorShape& image = image_shape(step);
    const std::int64_t block = step.block_size;
    if (block < 2 || block > 1024 || image[3] % (block * block) != 0)
      fail_here("has blocks of side {} in {} channels", block, image[3]);
    return {image[0], image[1] * block, image[2] * block, image[3] / (block * block)};
  }

  TensorShape shape_of_padding(const NetworkOperator& step) const {
    require_inputs(step, 1);
    return padded_shape(step);
  }

  TensorShape shape_of_prelu(const NetworkOperator& step) const {
    require_inputs(step, 2);
    const TensorShape& image = image_shape(step);
    require_constant(step.inputs[1]);
    if (shape_of(step.inputs[1]) != TensorShape{1, 1, image[3]})
      fail_here("its factors are {}, expected 1x1x{}, one for each channel", to_string(shape_of(step.inputs[1])),
                image[3]);
    return image;
  }

  /// The shape of the first input with the zeros of the operator around it.
  TensorShape padded_shape(const NetworkOperator& step) const {
    TensorShape shape = shape_of(step.inputs[0]);
    for (std::size_t i = 0; i < step.pad_before.size(); ++i) {
      const std::int64_t before = step.pad_before[i], after = step.pad_after[i];
      if (before < 0 || after < 0 || before > kMaxPadding || after > kMaxPadding)
        fail_here("adds {} and {} elements to axis {}", before, after, i);
      shape[i] += before + after;
    }
    return shape;
  }

  TensorShape shape_of_resize(const NetworkOperator& step) const {
    require_inputs(step, 1);
    const TensorShape &image = image_shape(step), &result = shape_of(step.output);
    if (result.size() != 4) fail_here("its output is {}, expected four axes", to_string(result));
    return {image[0], result[1], result[2], image[3]};
  }

  TensorShape shape_of_reshape(const NetworkOperator& step) const {
    require_inputs(step, 1);
    const TensorShape &from = shape_of(step.inputs[0]), &to = shape_of(step.output);
    return num_elements(from) == num_elements(to) ? to : from;
  }

  const NetworkModel& model_;
  std::vector<bool> known_;  ///< by tensor: constant, or computed so far
  std::size_t number_ = 0;   ///< of the operator
};

}  // namespace

void check_shapes(const NetworkModel& model) { ShapeCheck(model).run(); }

const NetworkModel& require_tensors(const NetworkModel& model, const std::vector<TensorShape>& expected,
                                    const char* network) {
  std::vector<TensorShape> found;
  for (const auto* tensors : {&model.inputs, &model.outputs})
    for (const int tensor : *tensors) found.push_back(model.tensors[tensor].shape);
  if (found != expected) fail_at({model.source, 0}, "has other inputs or outputs than {}", network);
  return model;
}

SamePadding same_padding(std::int64_t size, std::int64_t window, std::int64_t stride) {
  const std::int64_t windows = (size + stride - 1) / stride;
  const std::int64_t total = std::max<std::int64_t>(0, (windows - 1) * stride + window - size);
  return {total / 2, total - total / 2};
}

}  // namespace doppel
