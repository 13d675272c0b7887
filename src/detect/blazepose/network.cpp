#include "doppel/detect/blazepose/network.h"

#include <pthreadpool.h>
#include <xnnpack.h>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/network_edits.h"
#include "doppel/detect/blazepose/network_shapes.h"

namespace doppel {

namespace {

constexpr int kMaxNetworkThreads = 64;
/// XNNPACK reads beyond the end of arrays, but never writes there.
constexpr std::size_t kSpareFloats = XNN_EXTRA_BYTES / sizeof(float);

struct SubgraphDeleter {
  void operator()(xnn_subgraph_t graph) const { xnn_delete_subgraph(graph); }
};

std::vector<std::size_t> sizes_of(const TensorShape& shape) { return {shape.begin(), shape.end()}; }

/// Zeros on the four sides of an image.
struct Borders {
  std::uint32_t top = 0, right = 0, bottom = 0, left = 0;
};

/// Builds XNNPACK's graph of a checked model.
class GraphBuilder {
 public:
  /// @param constants must outlive the network: XNNPACK reads them again
  GraphBuilder(const NetworkModel& model, std::vector<std::vector<float>>& constants)
      : model_(model), constants_(constants), ids_(model.tensors.size(), XNN_INVALID_VALUE_ID) {
    xnn_subgraph_t graph = nullptr;
    const auto externals = static_cast<std::uint32_t>(model.inputs.size() + model.outputs.size());
    if (xnn_initialize(nullptr) != xnn_status_success ||
        xnn_create_subgraph(externals, 0, &graph) != xnn_status_success)
      fail_at({model.source, 0}, "setting up XNNPACK failed: this processor may be too old, or memory has run out");
    graph_.reset(graph);
  }

  /// External values are numbered from 0: the inputs, then the outputs.
  std::unique_ptr<xnn_subgraph, SubgraphDeleter> build() {
    std::uint32_t external = 0;
    for (const int input : model_.inputs) define(input, external++, XNN_VALUE_FLAG_EXTERNAL_INPUT);
    for (const int output : model_.outputs) define(output, external++, XNN_VALUE_FLAG_EXTERNAL_OUTPUT);
    for (const NetworkOperator& step : model_.operators) add(step);
    return std::move(graph_);
  }

 private:
  void require(xnn_status status, const std::string& what) const {
    if (status != xnn_status_success)
      fail_at({model_.source, 0}, "XNNPACK refuses {} (its error {})", what, static_cast<int>(status));
  }

  std::uint32_t define_value(const TensorShape& shape, const float* values, std::uint32_t external,
                             std::uint32_t flags) const {
    std::uint32_t id = XNN_INVALID_VALUE_ID;
    const std::vector<std::size_t> sizes = sizes_of(shape);
    require(xnn_define_tensor_value(graph_.get(), xnn_datatype_fp32, sizes.size(), sizes.data(), values, external,
                                    flags, &id),
            "a tensor of " + to_string(shape));
    return id;
  }

  std::uint32_t define(int tensor, std::uint32_t external, std::uint32_t flags) {
    const NetworkTensor& known = model_.tensors[tensor];
    const float* values = nullptr;
    if (known.values != nullptr) {
      constants_.push_back(*known.values);
      constants_.back().resize(known.values->size() + kSpareFloats);
      values = constants_.back().data();
    }
    return ids_[tensor] = define_value(known.shape, values, external, flags);
  }

  std::uint32_t id_of(int tensor) {
    const std::uint32_t id = ids_[tensor];
    return id != XNN_INVALID_VALUE_ID ? id : define(tensor, XNN_INVALID_VALUE_ID, 0);
  }

  std::uint32_t input_id(const NetworkOperator& step, std::size_t index = 0) { return id_of(step.inputs[index]); }
  const TensorShape& shape_of(int tensor) const { return model_.tensors[tensor].shape; }

  void add(const NetworkOperator& step) {
    const std::string what = fmt::format("{}, which computes {}", to_string(step.op), model_.tensors[step.output].name);
    if (step.op == NetworkOp::concatenation) return add_concatenation(step, what);
    require(define_operator(step), what);
  }

  xnn_status define_operator(const NetworkOperator& step) {
    const std::uint32_t input = input_id(step), output = id_of(step.output);
    const TensorShape& result = shape_of(step.output);
    switch (step.op) {
      case NetworkOp::add:
        return xnn_define_add2(graph_.get(), step.least, step.most, input, input_id(step, 1), output, 0);
      case NetworkOp::conv_2d:
        return define_convolution(step);
      case NetworkOp::depthwise_conv_2d:
        return define_depthwise(step);
      case NetworkOp::depth_to_space:
        return xnn_define_depth_to_space(graph_.get(), input, output, static_cast<std::uint32_t>(step.block_size), 0);
      case NetworkOp::max_pool_2d:
        return define_pooling(step);
      case NetworkOp::pad:
        return define_padding(step.pad_before, step.pad_after, input, output);
      case NetworkOp::reshape: {
        const std::vector<std::size_t> sizes = sizes_of(result);
        return xnn_define_static_reshape(graph_.get(), sizes.size(), sizes.data(), input, output, 0);
      }
      case NetworkOp::resize_bilinear:
        return xnn_define_static_resize_bilinear_2d(graph_.get(), as_size(result[1]), as_size(result[2]), input, output,
                                                    0);
      default:
        return xnn_define_sigmoid(graph_.get(), input, output, 0);
    }
  }

  Borders borders_of(const NetworkOperator& step, std::int64_t height, std::int64_t width) const {
    SamePadding y, x;
    if (step.same_padding) {
      const TensorShape& image = shape_of(step.inputs[0]);
      y = same_padding(image[1], height, step.stride_y);
      x = same_padding(image[2], width, step.stride_x);
    } else if (!step.pad_before.empty()) {
      y = {step.pad_before[1], step.pad_after[1]};
      x = {step.pad_before[2], step.pad_after[2]};
    }
    return {static_cast<std::uint32_t>(y.before), static_cast<std::uint32_t>(x.after),
            static_cast<std::uint32_t>(y.after), static_cast<std::uint32_t>(x.before)};
  }

  xnn_status define_convolution(const NetworkOperator& step) {
    const TensorShape& weights = shape_of(step.inputs[1]);
    const Borders zeros = borders_of(step, weights[1], weights[2]);
    return xnn_define_convolution_2d(
        graph_.get(), zeros.top, zeros.right, zeros.bottom, zeros.left, static_cast<std::uint32_t>(weights[1]),
        static_cast<std::uint32_t>(weights[2]), static_cast<std::uint32_t>(step.stride_y),
        static_cast<std::uint32_t>(step.stride_x), 1, 1, 1, as_size(weights[3]), as_size(weights[0]), step.least,
        step.most, input_id(step), input_id(step, 1), input_id(step, 2), id_of(step.output), 0);
  }

  xnn_status define_depthwise(const NetworkOperator& step) {
    const TensorShape& weights = shape_of(step.inputs[1]);
    const Borders zeros = borders_of(step, weights[1], weights[2]);
    return xnn_define_depthwise_convolution_2d(
        graph_.get(), zeros.top, zeros.right, zeros.bottom, zeros.left, static_cast<std::uint32_t>(weights[1]),
        static_cast<std::uint32_t>(weights[2]), static_cast<std::uint32_t>(step.stride_y),
        static_cast<std::uint32_t>(step.stride_x), 1, 1, 1, as_size(weights[3]), step.least, step.most, input_id(step),
        input_id(step, 1), input_id(step, 2), id_of(step.output), 0);
  }

  xnn_status define_pooling(const NetworkOperator& step) {
    const Borders zeros = borders_of(step, step.window_height, step.window_width);
    return xnn_define_max_pooling_2d(
        graph_.get(), zeros.top, zeros.right, zeros.bottom, zeros.left, static_cast<std::uint32_t>(step.window_height),
        static_cast<std::uint32_t>(step.window_width), static_cast<std::uint32_t>(step.stride_y),
        static_cast<std::uint32_t>(step.stride_x), 1, 1, step.least, step.most, input_id(step), id_of(step.output), 0);
  }

  xnn_status define_padding(const std::vector<std::int64_t>& before, const std::vector<std::int64_t>& after,
                            std::uint32_t input, std::uint32_t output) const {
    return xnn_define_static_constant_pad(graph_.get(), sizes_of(before).data(), sizes_of(after).data(), 0.0f, input,
                                          output, 0);
  }

  /// Debian's XNNPACK has no concatenation. It is the sum of the inputs, each with zeros in place of the others.
  void add_concatenation(const NetworkOperator& step, const std::string& what) {
    const TensorShape& result = shape_of(step.output);
    std::int64_t begin = 0;
    std::uint32_t sum = XNN_INVALID_VALUE_ID;
    for (std::size_t i = 0; i < step.inputs.size(); ++i) {
      const std::int64_t size = shape_of(step.inputs[i])[step.axis];
      std::vector<std::int64_t> before(result.size(), 0), after(result.size(), 0);
      before[step.axis] = begin;
      after[step.axis] = result[step.axis] - begin - size;
      begin += size;
      const bool only = step.inputs.size() == 1, last = i + 1 == step.inputs.size();
      const std::uint32_t padded = only ? id_of(step.output) : define_value(result, nullptr, XNN_INVALID_VALUE_ID, 0);
      require(define_padding(before, after, input_id(step, i), padded), what);
      if (i == 0) {
        sum = padded;
        continue;
      }
      const std::uint32_t next = last ? id_of(step.output) : define_value(result, nullptr, XNN_INVALID_VALUE_ID, 0);
      require(xnn_define_add2(graph_.get(), step.least, step.most, sum, padded, next, 0), what);
      sum = next;
    }
  }

  const NetworkModel& model_;
  std::vector<std::vector<float>>& constants_;
  std::vector<std::uint32_t> ids_;  ///< XNNPACK's numbers of the tensors
  std::unique_ptr<xnn_subgraph, SubgraphDeleter> graph_;
};

}  // namespace

struct NetworkThreads::Impl {
  pthreadpool_t pool = nullptr;
};

NetworkThreads::NetworkThreads(int count) : impl_(std::make_unique<Impl>()) {
  if (count < 1 || count > kMaxNetworkThreads)
    fail<UsageError>("starting the threads of a network: found {}; allowed is 1 to {}", count, kMaxNetworkThreads);
  // Without a pool, XNNPACK computes in the calling thread.
  if (count > 1) impl_->pool = pthreadpool_create(as_size(count));
}

NetworkThreads::~NetworkThreads() {
  if (impl_->pool != nullptr) pthreadpool_destroy(impl_->pool);
}

struct Network::Impl {
  struct RuntimeDeleter {
    void operator()(xnn_runtime_t ended) const { xnn_delete_runtime(ended); }
  };
  std::shared_ptr<NetworkThreads> threads;
  std::string source;
  std::vector<TensorShape> shapes;          ///< of the input and the outputs
  std::vector<std::vector<float>> buffers;  ///< the same
  std::vector<std::vector<float>> constants;
  std::unique_ptr<xnn_runtime, RuntimeDeleter> runtime;

  /// Gives the network its input and its outputs, in the order of their numbers.
  void connect(const NetworkModel& model) {
    std::vector<int> tensors = model.inputs;
    tensors.insert(tensors.end(), model.outputs.begin(), model.outputs.end());
    std::vector<xnn_external_value> values;
    for (const int tensor : tensors) {
      shapes.push_back(model.tensors[tensor].shape);
      buffers.emplace_back(as_size(num_elements(shapes.back())) + kSpareFloats, 0.0f);
      values.push_back({static_cast<std::uint32_t>(values.size()), buffers.back().data()});
    }
    if (xnn_setup_runtime(runtime.get(), values.size(), values.data()) != xnn_status_success)
      fail_at({source, 0}, "XNNPACK cannot plan the memory of this network");
  }
};

Network::Network(const NetworkModel& given, std::shared_ptr<NetworkThreads> threads) : impl_(std::make_unique<Impl>()) {
  check_shapes(given);
  if (given.inputs.size() != 1)
    fail_at({given.source, 0}, "the network has {} inputs, expected 1", given.inputs.size());
  const NetworkModel model = fold_padding(given);
  impl_->threads = std::move(threads);
  impl_->source = model.source;
  const auto graph = GraphBuilder(model, impl_->constants).build();
  xnn_runtime_t runtime = nullptr;
  if (xnn_create_runtime_v2(graph.get(), impl_->threads->impl_->pool, XNN_FLAG_YIELD_WORKERS, &runtime) !=
      xnn_status_success)
    fail_at({model.source, 0}, "XNNPACK cannot compute this network");
  impl_->runtime.reset(runtime);
  impl_->connect(model);
}

Network::~Network() = default;
Network::Network(Network&&) noexcept = default;
Network& Network::operator=(Network&&) noexcept = default;

const TensorShape& Network::output_shape(std::size_t index) const { return impl_->shapes.at(index + 1); }

std::span<float> Network::input() { return {impl_->buffers[0].data(), as_size(num_elements(impl_->shapes[0]))}; }

void Network::run() {
  if (xnn_invoke_runtime(impl_->runtime.get()) != xnn_status_success)
    fail_at({impl_->source, 0}, "running the network failed inside XNNPACK");
}

std::span<const float> Network::output(std::size_t index) const {
  return {impl_->buffers.at(index + 1).data(), as_size(num_elements(output_shape(index)))};
}

}  // namespace doppel
