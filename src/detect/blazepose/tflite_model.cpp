#include "doppel/detect/blazepose/tflite_model.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <opencv2/core.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/sparse_constant.h"
#include "tflite_generated.h"

static_assert(std::endian::native == std::endian::little, "buffers of the file are used as they are");

namespace doppel {

namespace {

constexpr std::uintmax_t kTfliteMaxBytes = std::uintmax_t{256} << 20;
constexpr std::int64_t kTfliteMaxElements = std::int64_t{1} << 28;  ///< of all tensors together: 1 GB of float32
constexpr std::size_t kTfliteMaxAxes = 4;

template <typename T>
std::vector<std::int64_t> widened(const flatbuffers::Vector<T>* list) {
  std::vector<std::int64_t> result;
  if (list != nullptr) result.assign(list->begin(), list->end());
  return result;
}

/// The numbers of a sparse axis, which are stored as 8, 16 or 32 bits.
std::vector<std::int64_t> sparse_numbers(tflite::SparseIndexVector kind, const void* list) {
  if (list == nullptr) return {};
  switch (kind) {
    case tflite::SparseIndexVector::Int32Vector:
      return widened(static_cast<const tflite::Int32Vector*>(list)->values());
    case tflite::SparseIndexVector::Uint16Vector:
      return widened(static_cast<const tflite::Uint16Vector*>(list)->values());
    case tflite::SparseIndexVector::Uint8Vector:
      return widened(static_cast<const tflite::Uint8Vector*>(list)->values());
    default:
      return {};
  }
}

std::string operator_name(const tflite::OperatorCode& code) {
  // Files of older programs have the number in the first field only.
  const int number = std::max(static_cast<int>(code.code()), static_cast<int>(code.old_code()));
  if (code.custom_code() != nullptr) return "custom operator " + code.custom_code()->str().substr(0, 60);
  const char* name = tflite::EnumNameBuiltinOperator(static_cast<tflite::BuiltinOperator>(number));
  return name[0] != '\0' ? name : "operator " + std::to_string(number);
}

/// Reads one file; messages name the tensor or the operator.
class TfliteReader {
 public:
  TfliteReader(const std::filesystem::path& path, const std::optional<FilePart>& part) : where_{path.string(), 0} {
    bytes_ = read_file(path, kTfliteMaxBytes);
    if (part) cut_out(*part);
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes_.data());
    flatbuffers::Verifier verifier(data, bytes_.size(), 32, 100000);
    if (bytes_.size() < 8 || !tflite::ModelBufferHasIdentifier(data) || !tflite::VerifyModelBuffer(verifier))
      fail_read("the file is no TensorFlow Lite model, or it is truncated or damaged");
    file_ = tflite::GetModel(data);
    if (file_->subgraphs() == nullptr || file_->subgraphs()->size() != 1)
      fail_read("the file has {} graphs, expected 1", file_->subgraphs() == nullptr ? 0 : file_->subgraphs()->size());
    graph_ = file_->subgraphs()->Get(0);
  }

  NetworkModel read() {
    model_.source = where_.file;
    read_tensors();
    for (std::size_t i = 0; i < count(graph_->operators()); ++i) {
      operator_ = static_cast<int>(i);
      read_operator(*graph_->operators()->Get(static_cast<flatbuffers::uoffset_t>(i)));
    }
    model_.inputs = tensor_indices(graph_->inputs(), "the inputs of the network");
    model_.outputs = tensor_indices(graph_->outputs(), "the outputs of the network");
    check_shapes(model_);
    return std::move(model_);
  }

 private:
  void cut_out(const FilePart& part) {
    if (part.offset > bytes_.size() || part.size > bytes_.size() - part.offset)
      fail_read("the network should have {} bytes from byte {}, but the file has {} bytes", part.size, part.offset,
                bytes_.size());
    bytes_ = bytes_.substr(part.offset, part.size);
  }

  template <typename... Args>
  [[noreturn]] void fail_read(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where_, "reading a network: {}", fmt::format(format, std::forward<Args>(args)...));
  }

  template <typename Vector>
  static std::size_t count(const Vector* list) {
    return list == nullptr ? 0 : list->size();
  }

  void read_tensors() {
    std::int64_t elements = 0;
    for (std::size_t i = 0; i < count(graph_->tensors()); ++i) {
      const tflite::Tensor& stored = *graph_->tensors()->Get(static_cast<flatbuffers::uoffset_t>(i));
      NetworkTensor tensor;
      tensor.name = stored.name() != nullptr ? stored.name()->str().substr(0, 200) : "tensor " + std::to_string(i);
      tensor.shape = read_shape(stored, tensor.name, elements);
      const flatbuffers::Vector<std::uint8_t>* data = data_of(stored, tensor.name);
      if (count(data) > 0) read_constant(stored, *data, static_cast<int>(i), tensor);
      model_.tensors.push_back(std::move(tensor));
    }
  }

  /// @param elements counts the elements of all tensors
  TensorShape read_shape(const tflite::Tensor& stored, const std::string& name, std::int64_t& elements) const {
    const TensorShape shape = widened(stored.shape());
    if (shape.size() > kTfliteMaxAxes)
      fail_read("tensor {} has {} axes, at most {} are allowed", name, shape.size(), kTfliteMaxAxes);
    std::int64_t size = 1;
    for (const std::int64_t side : shape) {
      if (side < 1) fail_read("tensor {} has an axis of {} elements", name, side);
      if (size <= kTfliteMaxElements) size *= side;
    }
    elements += size;
    if (elements > kTfliteMaxElements) fail_read("the tensors up to {} need more than 1 GB", name);
    return shape;
  }

  const flatbuffers::Vector<std::uint8_t>* data_of(const tflite::Tensor& stored, const std::string& name) const {
    if (stored.buffer() >= count(file_->buffers()))
      fail_read("tensor {} has buffer {}, but the file has {}", name, stored.buffer(), count(file_->buffers()));
    return file_->buffers()->Get(stored.buffer())->data();
  }

  void read_constant(const tflite::Tensor& stored, const flatbuffers::Vector<std::uint8_t>& data, int index,
                     NetworkTensor& tensor) {
    if (stored.type() == tflite::TensorType::INT32) {
      std::vector<std::int32_t> values(data.size() / 4);
      std::memcpy(values.data(), data.data(), 4 * values.size());
      integers_[index] = values;
      return;
    }
    std::vector<float> values = read_floats(stored, data, tensor.name);
    if (stored.sparsity() != nullptr) values = expanded(*stored.sparsity(), values, tensor);
    if (static_cast<std::int64_t>(values.size()) != num_elements(tensor.shape)) {
      fail_read("the constant {} has {} values, its shape {} needs {}", tensor.name, values.size(),
                to_string(tensor.shape), num_elements(tensor.shape));
    }
    tensor.values = std::make_shared<const std::vector<float>>(std::move(values));
  }

  std::vector<float> read_floats(const tflite::Tensor& stored, const flatbuffers::Vector<std::uint8_t>& data,
                                 const std::string& name) const {
    const bool halves = stored.type() == tflite::TensorType::FLOAT16;
    if (!halves && stored.type() != tflite::TensorType::FLOAT32)
      fail_read("the constant {} is of type {}, expected float32, float16 or int32", name,
                static_cast<int>(stored.type()));
    const std::size_t bytes = halves ? 2 : 4;
    if (data.size() % bytes != 0) fail_read("the constant {} has {} bytes", name, data.size());
    std::vector<float> values(data.size() / bytes);
    if (halves) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        cv::float16_t half;
        std::memcpy(&half, data.data() + 2 * i, 2);
        values[i] = static_cast<float>(half);
      }
    } else {
      std::memcpy(values.data(), data.data(), data.size());
    }
    return values;
  }

  /// The only sparse form that is read: axes in order, all dense but the last one, no blocks.
  std::vector<float> expanded(const tflite::SparsityParameters& sparsity, const std::vector<float>& stored,
                              const NetworkTensor& tensor) const {
    const std::size_t axes = tensor.shape.size();
    const std::vector<std::int64_t> order = widened(sparsity.traversal_order());
    bool known =
        axes > 0 && order.size() == axes && count(sparsity.block_map()) == 0 && count(sparsity.dim_metadata()) == axes;
    for (std::size_t i = 0; known && i < axes; ++i) {
      const tflite::DimensionMetadata& axis = *sparsity.dim_metadata()->Get(static_cast<flatbuffers::uoffset_t>(i));
      const bool sparse = axis.format() == tflite::DimensionType::SPARSE_CSR;
      known = order[i] == static_cast<std::int64_t>(i) && sparse == (i + 1 == axes) &&
              (sparse || axis.dense_size() == tensor.shape[i]);
    }
    if (!known)
      fail_read("the sparse constant {} has another form than dense axes in order and one sparse axis at the end",
                tensor.name);
    const tflite::DimensionMetadata& last =
        *sparsity.dim_metadata()->Get(static_cast<flatbuffers::uoffset_t>(axes - 1));
    const SparseRows rows{sparse_numbers(last.array_segments_type(), last.array_segments()),
                          sparse_numbers(last.array_indices_type(), last.array_indices())};
    const auto dense = expand_rows(rows, stored, tensor.shape);
    if (!dense) fail_read("the sparse constant {} has rows or columns that contradict each other", tensor.name);
    return *dense;
  }

  int tensor_index(int index, const std::string& what) const {
    if (index < 0 || as_size(index) >= model_.tensors.size())
      fail_read("{}: tensor {} does not exist, the network has {}", what, index, model_.tensors.size());
    return index;
  }

  std::vector<int> tensor_indices(const flatbuffers::Vector<std::int32_t>* list, const std::string& what) const {
    std::vector<int> result;
    for (std::size_t i = 0; i < count(list); ++i)
      result.push_back(tensor_index(list->Get(static_cast<flatbuffers::uoffset_t>(i)), what));
    if (result.empty()) fail_read("{}: there are none", what);
    return result;
  }

  void read_operator(const tflite::Operator& stored) {
    if (stored.opcode_index() >= count(file_->operator_codes()))
      fail_read("operator {} has code {}, but the file has {} codes", operator_, stored.opcode_index(),
                count(file_->operator_codes()));
    name_ = operator_name(*file_->operator_codes()->Get(stored.opcode_index()));
    const std::string what = fmt::format("operator {}, {}", operator_, name_);
    NetworkOperator result;
    result.inputs = tensor_indices(stored.inputs(), what + ", inputs");
    const std::vector<int> outputs = tensor_indices(stored.outputs(), what + ", outputs");
    if (outputs.size() != 1) fail_read("{} has {} outputs, expected 1", what, outputs.size());
    result.output = outputs[0];
    if (name_ == "DEQUANTIZE" || name_ == "DENSIFY") return pass_constant(result, what);
    const auto known = network_operators().find(name_);
    if (known == network_operators().end())
      fail_read(
          "{}: this operator is not known; known are ADD, CONCATENATION, CONV_2D, DENSIFY, DEPTHWISE_CONV_2D, "
          "DEPTH_TO_SPACE, DEQUANTIZE, FULLY_CONNECTED, LOGISTIC, MAX_POOL_2D, MEAN, PAD, PRELU, RESHAPE "
          "and RESIZE_BILINEAR",
          what);
    result.op = known->second;
    read_options(stored, result, what);
    drop_integer_inputs(result);
    model_.operators.push_back(std::move(result));
  }

  /// The operators that only convert constants: the conversion is done already.
  void pass_constant(const NetworkOperator& step, const std::string& what) {
    const NetworkTensor& from = model_.tensors[step.inputs[0]];
    NetworkTensor& to = model_.tensors[step.output];
    if (from.values == nullptr || step.inputs.size() != 1)
      fail_read("{} has the input {}, which is no float constant; only constants can be converted", what, from.name);
    if (from.shape != to.shape || to.values != nullptr)
      fail_read("{} turns {} of {} into {} of {}", what, from.name, to_string(from.shape), to.name,
                to_string(to.shape));
    to.values = from.values;
  }

  /// Sizes of RESIZE_BILINEAR and RESHAPE follow from the output; the numbers of PAD and MEAN are read with the
  /// options.
  void drop_integer_inputs(NetworkOperator& step) const {
    const bool has_numbers = step.op == NetworkOp::pad || step.op == NetworkOp::mean || step.op == NetworkOp::reshape ||
                             step.op == NetworkOp::resize_bilinear;
    if (has_numbers && step.inputs.size() == 2 && integers_.contains(step.inputs[1])) step.inputs.pop_back();
  }

  void read_options(const tflite::Operator& stored, NetworkOperator& step, const std::string& what) const {
    switch (step.op) {
      case NetworkOp::conv_2d:
        return read_window(stored.options_as_Conv2DOptions(), step, what);
      case NetworkOp::depthwise_conv_2d:
        return read_window(stored.options_as_DepthwiseConv2DOptions(), step, what);
      case NetworkOp::max_pool_2d:
        return read_pooling(stored.options_as_Pool2DOptions(), step, what);
      case NetworkOp::add: {
        const tflite::AddOptions* options = stored.options_as_AddOptions();
        return options == nullptr ? void() : read_activation(options->activation(), step, what);
      }
      case NetworkOp::fully_connected:
        return read_matrix(stored.options_as_FullyConnectedOptions(), step, what);
      case NetworkOp::mean:
        return check_mean(step, what);
      case NetworkOp::concatenation:
        return read_concatenation(stored.options_as_ConcatenationOptions(), step, what);
      case NetworkOp::depth_to_space:
        return read_block(stored.options_as_DepthToSpaceOptions(), step, what);
      case NetworkOp::resize_bilinear:
        return check_resize(stored.options_as_ResizeBilinearOptions(), what);
      case NetworkOp::pad:
        return read_padding(step, what);
      case NetworkOp::prelu:
      case NetworkOp::reshape:
      case NetworkOp::logistic:
        return;
    }
  }

  void read_activation(tflite::Activation activation, NetworkOperator& step, const std::string& what) const {
    constexpr float kNoLimit = std::numeric_limits<float>::infinity();
    static const std::map<tflite::Activation, std::pair<float, float>> ranges = {
        {tflite::Activation::NONE, {-kNoLimit, kNoLimit}},
        {tflite::Activation::RELU, {0.0f, kNoLimit}},
        {tflite::Activation::RELU_N1_TO_1, {-1.0f, 1.0f}},
        {tflite::Activation::RELU6, {0.0f, 6.0f}}};
    const auto range = ranges.find(activation);
    if (range == ranges.end())
      fail_read("{} has the activation {}; known are none, RELU, RELU_N1_TO_1 and RELU6", what,
                static_cast<int>(activation));
    std::tie(step.least, step.most) = range->second;
  }

  template <typename Options>
  void read_window_steps(const Options* options, NetworkOperator& step, const std::string& what) const {
    if (options == nullptr) fail_read("{} has no options", what);
    step.stride_x = options->stride_w();
    step.stride_y = options->stride_h();
    if (step.stride_x < 1 || step.stride_y < 1 || step.stride_x > 1024 || step.stride_y > 1024)
      fail_read("{} has strides {} and {}, expected 1 to 1024", what, step.stride_x, step.stride_y);
    if (options->padding() != tflite::Padding::SAME && options->padding() != tflite::Padding::VALID)
      fail_read("{} has the padding {}, expected SAME or VALID", what, static_cast<int>(options->padding()));
    step.same_padding = options->padding() == tflite::Padding::SAME;
    read_activation(options->activation(), step, what);
  }

  template <typename Options>
  void read_window(const Options* options, NetworkOperator& step, const std::string& what) const {
    read_window_steps(options, step, what);
    if (options->dilation_w() != 1 || options->dilation_h() != 1)
      fail_read("{} has dilations {} and {}, expected 1", what, options->dilation_w(), options->dilation_h());
  }

  void read_pooling(const tflite::Pool2DOptions* options, NetworkOperator& step, const std::string& what) const {
    read_window_steps(options, step, what);
    step.window_width = options->filter_width();
    step.window_height = options->filter_height();
  }

  void read_concatenation(const tflite::ConcatenationOptions* options, NetworkOperator& step,
                          const std::string& what) const {
    if (options == nullptr || options->activation() != tflite::Activation::NONE)
      fail_read("{} needs options without an activation", what);
    const auto axes = static_cast<int>(model_.tensors[step.output].shape.size());
    step.axis = options->axis() < 0 ? options->axis() + axes : options->axis();
  }

  void read_matrix(const tflite::FullyConnectedOptions* options, NetworkOperator& step, const std::string& what) const {
    if (options == nullptr || options->weights_format() != 0) fail_read("{} needs options, and weights in rows", what);
    read_activation(options->activation(), step, what);
  }

  void check_mean(const NetworkOperator& step, const std::string& what) const {
    const auto numbers = step.inputs.size() == 2 ? integers_.find(step.inputs[1]) : integers_.end();
    std::vector<std::int32_t> axes;
    if (numbers != integers_.end()) axes = numbers->second;
    for (std::int32_t& axis : axes) axis += axis < 0 ? 4 : 0;
    std::sort(axes.begin(), axes.end());
    if (axes != std::vector<std::int32_t>{1, 2}) fail_read("{} must be over the axes 1 and 2 of an image", what);
  }

  void read_block(const tflite::DepthToSpaceOptions* options, NetworkOperator& step, const std::string& what) const {
    if (options == nullptr) fail_read("{} has no options", what);
    step.block_size = options->block_size();
  }

  void check_resize(const tflite::ResizeBilinearOptions* options, const std::string& what) const {
    if (options == nullptr || options->align_corners() || !options->half_pixel_centers())
      fail_read("{} must have half-pixel centres and no aligned corners", what);
  }

  void read_padding(NetworkOperator& step, const std::string& what) const {
    const auto numbers = step.inputs.size() == 2 ? integers_.find(step.inputs[1]) : integers_.end();
    const std::size_t axes = model_.tensors[step.inputs[0]].shape.size();
    if (numbers == integers_.end() || numbers->second.size() != 2 * axes)
      fail_read("{} needs two constant integers for each of {} axes", what, axes);
    for (std::size_t i = 0; i < axes; ++i) {
      step.pad_before.push_back(numbers->second[2 * i]);
      step.pad_after.push_back(numbers->second[2 * i + 1]);
    }
  }

  FileLocation where_;
  std::string bytes_;
  const tflite::Model* file_ = nullptr;
  const tflite::SubGraph* graph_ = nullptr;
  NetworkModel model_;
  std::map<int, std::vector<std::int32_t>> integers_;  ///< constants of int32 by tensor
  int operator_ = 0;
  std::string name_;  ///< of the operator
};

}  // namespace

NetworkModel read_tflite(const std::filesystem::path& path, const std::optional<FilePart>& part) {
  return TfliteReader(path, part).read();
}

}  // namespace doppel
