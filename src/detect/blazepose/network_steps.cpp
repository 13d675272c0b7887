#include "doppel/detect/blazepose/network_steps.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/network_shapes.h"

namespace doppel {

namespace {

using Dims = dnnl::memory::dims;
using Desc = dnnl::memory::desc;
constexpr auto kFloat = dnnl::memory::data_type::f32;
constexpr auto kAnyLayout = dnnl::memory::format_tag::any;
constexpr auto kInference = dnnl::prop_kind::forward_inference;

/// The descriptor of a primitive, in both forms that versions of oneDNN ask for.
template <typename Primitive, typename... Arguments>
typename Primitive::primitive_desc describe(const dnnl::engine& engine, const dnnl::primitive_attr& attributes,
                                            Arguments... arguments) {
#if DNNL_VERSION_MAJOR < 3
  return {typename Primitive::desc(arguments...), attributes, engine};
#else
  return {engine, arguments..., attributes};
#endif
}

/// oneDNN names the axes of an image as batch, channels, rows, columns, whatever their order in memory.
Dims logical(const TensorShape& shape) {
  if (shape.size() == 4) return {shape[0], shape[3], shape[1], shape[2]};
  return shape.empty() ? Dims{1} : Dims(shape.begin(), shape.end());
}

/// Axis of `logical` for one of the file.
int logical_axis(int axis, std::size_t axes) {
  constexpr int kOfImage[] = {0, 2, 3, 1};
  return axes == 4 ? kOfImage[axis] : axis;
}

/// Without gaps, the last size running fastest.
Dims strides_of(const TensorShape& shape) {
  Dims strides(std::max<std::size_t>(1, shape.size()), 1);
  for (std::size_t i = shape.size(); i-- > 1;) strides[i - 1] = strides[i] * shape[i];
  return strides;
}

/// A tensor in the order of the file.
Desc in_order(const TensorShape& shape) { return {logical(shape), kFloat, logical(strides_of(shape))}; }

/// Zeros before and after the rows and columns of an image.
struct Borders {
  Dims before{0, 0}, after{0, 0};
};

/// A tensor that is computed.
struct Value {
  dnnl::memory memory;
  std::optional<std::size_t> buffer;  ///< nothing: it keeps its own memory
};

/// Memory from the step that writes it to the last one that reads it.
struct Buffer {
  std::size_t bytes = 0, first = 0, last = 0;
  std::vector<dnnl::memory> views;
};

class StepPlanner {
 public:
  explicit StepPlanner(const NetworkModel& model) : model_(model), values_(model.tensors.size()) {}

  NetworkSteps plan() {
    plan_.input = dnnl::memory(in_order(shape_of(model_.inputs[0])), plan_.engine);
    values_[model_.inputs[0]] = Value{plan_.input, {}};
    for (const NetworkOperator& step : model_.operators) {
      try {
        values_[step.output] = compute(step);
      } catch (const dnnl::error& e) {
        fail_at({model_.source, 0}, "oneDNN refuses {}, which computes {} ({})", to_string(step.op),
                model_.tensors[step.output].name, e.what());
      }
    }
    for (const int output : model_.outputs) {
      const dnnl::memory result(in_order(shape_of(output)), plan_.engine);
      reorder(value_of(output), {result, {}});
      plan_.outputs.push_back(result);
    }
    assign_blocks();
    return std::move(plan_);
  }

 private:
  const TensorShape& shape_of(int tensor) const { return model_.tensors[tensor].shape; }

  dnnl::memory constant(int tensor, const Desc& layout) const {
    const std::vector<float>& numbers = *model_.tensors[tensor].values;
    dnnl::memory memory(layout, plan_.engine);
    std::memcpy(memory.get_data_handle(), numbers.data(), numbers.size() * sizeof(float));
    return memory;
  }

  const Value& value_of(int tensor) {
    std::optional<Value>& value = values_[tensor];
    if (!value) value = Value{constant(tensor, in_order(shape_of(tensor))), {}};
    return *value;
  }

  /// Memory for the result of the next step.
  Value result(const Desc& layout) {
    const dnnl::memory memory(layout, plan_.engine, DNNL_MEMORY_NONE);
    buffers_.push_back({layout.get_size(), plan_.steps.size(), plan_.steps.size(), {memory}});
    return {memory, buffers_.size() - 1};
  }

  /// Other axes for the same numbers.
  Value view(const Value& value, const Desc& layout) {
    if (!value.buffer) {
      plan_.blocks.push_back(value.memory);  // a view does not own its memory
      return {dnnl::memory(layout, plan_.engine, value.memory.get_data_handle()), {}};
    }
    const dnnl::memory memory(layout, plan_.engine, DNNL_MEMORY_NONE);
    buffers_[*value.buffer].views.push_back(memory);
    return {memory, value.buffer};
  }

  void add(const dnnl::primitive& primitive, const std::unordered_map<int, Value>& values) {
    std::unordered_map<int, dnnl::memory> arguments;
    for (const auto& [role, value] : values) {
      arguments.emplace(role, value.memory);
      if (value.buffer) buffers_[*value.buffer].last = plan_.steps.size();
    }
    plan_.steps.push_back({primitive, std::move(arguments)});
  }

  void reorder(const Value& from, const Value& to) {
    add(dnnl::reorder(from.memory, to.memory), {{DNNL_ARG_FROM, from}, {DNNL_ARG_TO, to}});
  }

  Value in_layout(const Value& value, const Desc& layout) {
    if (value.memory.get_desc() == layout) return value;
    const Value to = result(layout);
    reorder(value, to);
    return to;
  }

  Value in_order_of_file(int tensor) { return in_layout(value_of(tensor), in_order(shape_of(tensor))); }

  Value compute(const NetworkOperator& step) {
    switch (step.op) {
      case NetworkOp::add:
        return sum(step);
      case NetworkOp::conv_2d:
      case NetworkOp::depthwise_conv_2d:
        return convolution(step);
      case NetworkOp::depth_to_space:
        return depth_to_space(step);
      case NetworkOp::fully_connected:
        return product(step);
      case NetworkOp::mean:
        return mean(step);
      case NetworkOp::max_pool_2d:
        return clamped(max_pool(step), step);
      case NetworkOp::pad:
        return padded(step);
      case NetworkOp::prelu:
        return prelu(step);
      case NetworkOp::reshape:
        return view(in_order_of_file(step.inputs[0]), in_order(shape_of(step.output)));
      case NetworkOp::resize_bilinear:
        return resized(step);
      case NetworkOp::concatenation:
        return clamped(concatenation(step), step);
      case NetworkOp::logistic:
        return elementwise(value_of(step.inputs[0]), dnnl::algorithm::eltwise_logistic, 0.0f, 0.0f);
    }
    fail("unknown operator of a network");
  }

  static bool clamps(const NetworkOperator& step) { return std::isfinite(step.least) || std::isfinite(step.most); }

  /// The fused activation.
  static dnnl::primitive_attr activation(const NetworkOperator& step) {
    dnnl::primitive_attr attributes;
    if (!clamps(step)) return attributes;
    dnnl::post_ops operations;
#if DNNL_VERSION_MAJOR < 3
    operations.append_eltwise(1.0f, dnnl::algorithm::eltwise_clip, step.least, step.most);
#else
    operations.append_eltwise(dnnl::algorithm::eltwise_clip, step.least, step.most);
#endif
    attributes.set_post_ops(operations);
    return attributes;
  }

  Value elementwise(const Value& from, dnnl::algorithm function, float alpha, float beta) {
    const Desc layout = from.memory.get_desc();
#if DNNL_VERSION_MAJOR < 3
    const auto described = describe<dnnl::eltwise_forward>(plan_.engine, {}, kInference, function, layout, alpha, beta);
#else
    const auto described =
        describe<dnnl::eltwise_forward>(plan_.engine, {}, kInference, function, layout, layout, alpha, beta);
#endif
    const Value to = result(layout);
    add(dnnl::eltwise_forward(described), {{DNNL_ARG_SRC, from}, {DNNL_ARG_DST, to}});
    return to;
  }

  Value clamped(const Value& value, const NetworkOperator& step) {
    return clamps(step) ? elementwise(value, dnnl::algorithm::eltwise_clip, step.least, step.most) : value;
  }

  Value prelu(const NetworkOperator& step) {
    const Value from = value_of(step.inputs[0]);
    const Desc layout = from.memory.get_desc();
    const TensorShape factors{1, 1, 1, shape_of(step.inputs[0])[3]};
    const Desc any(logical(factors), kFloat, kAnyLayout);
#if DNNL_VERSION_MAJOR < 3
    const auto described = describe<dnnl::prelu_forward>(plan_.engine, {}, kInference, layout, any);
#else
    const auto described = describe<dnnl::prelu_forward>(plan_.engine, {}, kInference, layout, any, layout);
#endif
    const Value to = result(layout);
    const dnnl::memory constants = constant(step.inputs[1], in_order(factors));
    add(dnnl::prelu_forward(described), {{DNNL_ARG_SRC, from},
                                         {DNNL_ARG_WEIGHTS, {packed(constants, described.weights_desc()), {}}},
                                         {DNNL_ARG_DST, to}});
    return to;
  }

  Value sum(const NetworkOperator& step) {
    const Value a = value_of(step.inputs[0]), b = in_layout(value_of(step.inputs[1]), a.memory.get_desc());
    const Desc layout = a.memory.get_desc();
    const auto described =
        describe<dnnl::binary>(plan_.engine, activation(step), dnnl::algorithm::binary_add, layout, layout, layout);
    const Value to = result(layout);
    add(dnnl::binary(described), {{DNNL_ARG_SRC_0, a}, {DNNL_ARG_SRC_1, b}, {DNNL_ARG_DST, to}});
    return to;
  }

  Borders borders_of(const NetworkOperator& step, std::int64_t height, std::int64_t width) const {
    if (step.same_padding) {
      const TensorShape& image = shape_of(step.inputs[0]);
      const SamePadding y = same_padding(image[1], height, step.stride_y),
                        x = same_padding(image[2], width, step.stride_x);
      return {{y.before, x.before}, {y.after, x.after}};
    }
    if (step.pad_before.empty()) return {};
    return {{step.pad_before[1], step.pad_before[2]}, {step.pad_after[1], step.pad_after[2]}};
  }

  Value convolution(const NetworkOperator& step) {
    const bool depthwise = step.op == NetworkOp::depthwise_conv_2d;
    const TensorShape& weights = shape_of(step.inputs[1]);
    const Dims filters = depthwise ? Dims{weights[3], 1, 1, weights[1], weights[2]} : logical(weights);
    const Desc in_file = depthwise ? Desc(filters, kFloat, dnnl::memory::format_tag::hwigo) : in_order(weights);
    const Borders zeros = borders_of(step, weights[1], weights[2]);
    const auto described = describe<dnnl::convolution_forward>(
        plan_.engine, activation(step), kInference, dnnl::algorithm::convolution_direct,
        Desc(logical(shape_of(step.inputs[0])), kFloat, kAnyLayout), Desc(filters, kFloat, kAnyLayout),
        in_order(shape_of(step.inputs[2])), Desc(logical(shape_of(step.output)), kFloat, kAnyLayout),
        Dims{step.stride_y, step.stride_x}, zeros.before, zeros.after);
    const Value from = in_layout(value_of(step.inputs[0]), described.src_desc());
    const Value to = result(described.dst_desc());
    add(dnnl::convolution_forward(described),
        {{DNNL_ARG_SRC, from},
         {DNNL_ARG_WEIGHTS, {packed(constant(step.inputs[1], in_file), described.weights_desc()), {}}},
         {DNNL_ARG_BIAS, {constant(step.inputs[2], in_order(shape_of(step.inputs[2]))), {}}},
         {DNNL_ARG_DST, to}});
    return to;
  }

  /// Weights in the layout of their convolution.
  dnnl::memory packed(dnnl::memory weights, const Desc& layout) {
    if (weights.get_desc() == layout) return weights;
    dnnl::memory result(layout, plan_.engine);
    dnnl::reorder(weights, result).execute(plan_.stream, weights, result);
    plan_.stream.wait();
    return result;
  }

  /// @param shape of the result @param window rows and columns
  Value pool(const NetworkOperator& step, dnnl::algorithm function, const TensorShape& shape, const Dims& window) {
    const Value from = value_of(step.inputs[0]);
    const Borders zeros = borders_of(step, window[0], window[1]);
    const Desc any(logical(shape), kFloat, kAnyLayout);
    const Dims stride{step.stride_y, step.stride_x};
#if DNNL_VERSION_MAJOR < 3
    const auto described = describe<dnnl::pooling_forward>(
        plan_.engine, {}, kInference, function, from.memory.get_desc(), any, stride, window, zeros.before, zeros.after);
#else
    const auto described =
        describe<dnnl::pooling_forward>(plan_.engine, {}, kInference, function, from.memory.get_desc(), any, stride,
                                        window, Dims{0, 0}, zeros.before, zeros.after);
#endif
    const Value to = result(described.dst_desc());
    add(dnnl::pooling_forward(described), {{DNNL_ARG_SRC, from}, {DNNL_ARG_DST, to}});
    return to;
  }

  Value max_pool(const NetworkOperator& step) {
    return pool(step, dnnl::algorithm::pooling_max, shape_of(step.output), {step.window_height, step.window_width});
  }

  /// The mean of the window that is the whole image.
  Value mean(const NetworkOperator& step) {
    const TensorShape& image = shape_of(step.inputs[0]);
    const TensorShape pixel{image[0], 1, 1, image[3]};
    const Value found = pool(step, dnnl::algorithm::pooling_avg_exclude_padding, pixel, {image[1], image[2]});
    return view(in_layout(found, in_order(pixel)), in_order(shape_of(step.output)));
  }

  Value product(const NetworkOperator& step) {
    const auto any = [&](int tensor) { return Desc(logical(shape_of(tensor)), kFloat, kAnyLayout); };
    const Desc result_in_order = in_order(shape_of(step.output)), bias = in_order(shape_of(step.inputs[2]));
    const auto described = describe<dnnl::inner_product_forward>(plan_.engine, activation(step), kInference,
                                                                 in_order(shape_of(step.inputs[0])),
                                                                 any(step.inputs[1]), bias, result_in_order);
    const Value from = in_order_of_file(step.inputs[0]);
    const Value to = result(result_in_order);
    const dnnl::memory weights = constant(step.inputs[1], in_order(shape_of(step.inputs[1])));
    add(dnnl::inner_product_forward(described), {{DNNL_ARG_SRC, from},
                                                 {DNNL_ARG_WEIGHTS, {packed(weights, described.weights_desc()), {}}},
                                                 {DNNL_ARG_BIAS, {constant(step.inputs[2], bias), {}}},
                                                 {DNNL_ARG_DST, to}});
    return to;
  }

  Value resized(const NetworkOperator& step) {
    const Value from = value_of(step.inputs[0]);
    const auto described = describe<dnnl::resampling_forward>(
        plan_.engine, {}, kInference, dnnl::algorithm::resampling_linear, from.memory.get_desc(),
        Desc(logical(shape_of(step.output)), kFloat, kAnyLayout));
    const Value to = result(described.dst_desc());
    add(dnnl::resampling_forward(described), {{DNNL_ARG_SRC, from}, {DNNL_ARG_DST, to}});
    return to;
  }

  /// The zeros around the result are written once, so its memory is not shared.
  Value padded(const NetworkOperator& step) {
    const dnnl::memory zeros(in_order(shape_of(step.output)), plan_.engine);
    std::memset(zeros.get_data_handle(), 0, zeros.get_desc().get_size());
    const TensorShape offsets(step.pad_before.begin(), step.pad_before.end());
    plan_.blocks.push_back(zeros);
    const Desc inner = zeros.get_desc().submemory_desc(logical(shape_of(step.inputs[0])),
                                                       offsets.empty() ? Dims{0} : logical(offsets));
    reorder(value_of(step.inputs[0]), {dnnl::memory(inner, plan_.engine, zeros.get_data_handle()), {}});
    return {zeros, {}};
  }

  Value concatenation(const NetworkOperator& step) {
    std::vector<Desc> layouts;
    std::unordered_map<int, Value> values;
    for (std::size_t i = 0; i < step.inputs.size(); ++i) {
      const Value part = in_order_of_file(step.inputs[i]);
      layouts.push_back(part.memory.get_desc());
      values.emplace(DNNL_ARG_MULTIPLE_SRC + static_cast<int>(i), part);
    }
    const Desc layout = in_order(shape_of(step.output));
    const int axis = logical_axis(step.axis, shape_of(step.output).size());
#if DNNL_VERSION_MAJOR < 3
    const dnnl::concat::primitive_desc described(layout, axis, layouts, plan_.engine);
#else
    const dnnl::concat::primitive_desc described(plan_.engine, layout, axis, layouts);
#endif
    const Value to = result(layout);
    values.emplace(DNNL_ARG_DST, to);
    add(dnnl::concat(described), values);
    return to;
  }

  /// A copy of six axes: batch, row, column, row and column in the block, channel.
  Value depth_to_space(const NetworkOperator& step) {
    const TensorShape &image = shape_of(step.inputs[0]), &larger = shape_of(step.output);
    const std::int64_t block = step.block_size, channels = larger[3], row = larger[2] * channels;
    const Dims sizes{image[0], image[1], image[2], block, block, channels};
    const Desc from(sizes, kFloat, strides_of(sizes));
    const Desc to(sizes, kFloat, Dims{larger[1] * row, block * row, block * channels, row, channels, 1});
    const Value input = view(in_order_of_file(step.inputs[0]), from);
    const Value output = result(in_order(larger));
    reorder(input, view(output, to));
    return output;
  }

  /// Gives each buffer a block of memory that no other one needs at the same time.
  void assign_blocks() {
    std::vector<std::size_t> block_of(buffers_.size());
    std::vector<std::size_t> bytes, free_from;  // of the blocks
    for (std::size_t i = 0; i < buffers_.size(); ++i) {
      std::optional<std::size_t> best;
      for (std::size_t b = 0; b < bytes.size(); ++b)
        if (free_from[b] <= buffers_[i].first && (!best || bytes[b] > bytes[*best])) best = b;
      if (!best) {
        best = bytes.size();
        bytes.push_back(0);
        free_from.push_back(0);
      }
      block_of[i] = *best;
      bytes[*best] = std::max(bytes[*best], buffers_[i].bytes);
      free_from[*best] = buffers_[i].last + 1;
    }
    std::vector<dnnl::memory> blocks;
    for (const std::size_t size : bytes) {
      const auto floats = static_cast<std::int64_t>((size + sizeof(float) - 1) / sizeof(float));
      blocks.emplace_back(Desc({floats}, kFloat, Dims{1}), plan_.engine);
    }
    for (std::size_t i = 0; i < buffers_.size(); ++i)
      for (dnnl::memory& view : buffers_[i].views) view.set_data_handle(blocks[block_of[i]].get_data_handle());
    plan_.blocks.insert(plan_.blocks.end(), blocks.begin(), blocks.end());
  }

  const NetworkModel& model_;
  NetworkSteps plan_;
  std::vector<std::optional<Value>> values_;  ///< of the tensors
  std::vector<Buffer> buffers_;               ///< in the order of their first step
};

}  // namespace

NetworkSteps plan_steps(const NetworkModel& model) { return StepPlanner(model).plan(); }

}  // namespace doppel
