#pragma once

#include <flatbuffers/flatbuffers.h>

#include <cstring>
#include <string>
#include <vector>

#include "tflite_generated.h"

/// Builds small network files for tests.
namespace doppel::support {

class SmallModel {
 public:
  SmallModel() {
    model_.version = 3;
    model_.buffers.push_back(std::make_unique<tflite::BufferT>());  // the buffer of tensors without data
    model_.subgraphs.push_back(std::make_unique<tflite::SubGraphT>());
  }

  /// A tensor that is computed.
  int tensor(const std::vector<int>& shape) { return add_tensor(shape, tflite::TensorType::FLOAT32, {}); }
  int constant(const std::vector<int>& shape, const std::vector<float>& values) {
    return add_tensor(shape, tflite::TensorType::FLOAT32, bytes_of(values));
  }
  int integers(const std::vector<int>& shape, const std::vector<std::int32_t>& values) {
    return add_tensor(shape, tflite::TensorType::INT32, bytes_of(values));
  }
  /// @param bits the float16 numbers
  int halves(const std::vector<int>& shape, const std::vector<std::uint16_t>& bits) {
    return add_tensor(shape, tflite::TensorType::FLOAT16, bytes_of(bits));
  }
  tflite::TensorT& stored(int tensor) { return *graph().tensors[static_cast<std::size_t>(tensor)]; }

  tflite::OperatorT& step(tflite::BuiltinOperator code, const std::vector<int>& inputs, int output) {
    auto known = std::make_unique<tflite::OperatorCodeT>();
    known->code = code;
    auto added = std::make_unique<tflite::OperatorT>();
    added->opcode_index = static_cast<std::uint32_t>(model_.operator_codes.size());
    added->inputs = inputs;
    added->outputs = {output};
    model_.operator_codes.push_back(std::move(known));
    graph().operators.push_back(std::move(added));
    return *graph().operators.back();
  }
  template <typename Options>
  void step(tflite::BuiltinOperator code, const std::vector<int>& inputs, int output, const Options& options) {
    step(code, inputs, output).options.Set(Options(options));
  }

  tflite::SubGraphT& graph() { return *model_.subgraphs[0]; }
  tflite::ModelT& model() { return model_; }

  /// The bytes of the file.
  std::string file(const std::vector<int>& inputs, const std::vector<int>& outputs) {
    graph().inputs = inputs;
    graph().outputs = outputs;
    flatbuffers::FlatBufferBuilder builder;
    tflite::FinishModelBuffer(builder, tflite::Model::Pack(builder, &model_));
    return {reinterpret_cast<const char*>(builder.GetBufferPointer()), builder.GetSize()};
  }

 private:
  template <typename T>
  static std::vector<std::uint8_t> bytes_of(const std::vector<T>& values) {
    std::vector<std::uint8_t> bytes(sizeof(T) * values.size());
    if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
  }

  int add_tensor(const std::vector<int>& shape, tflite::TensorType type, const std::vector<std::uint8_t>& data) {
    auto added = std::make_unique<tflite::TensorT>();
    added->shape = shape;
    added->type = type;
    added->name = "t" + std::to_string(graph().tensors.size());
    if (!data.empty()) {
      added->buffer = static_cast<std::uint32_t>(model_.buffers.size());
      auto buffer = std::make_unique<tflite::BufferT>();
      buffer->data = data;
      model_.buffers.push_back(std::move(buffer));
    }
    graph().tensors.push_back(std::move(added));
    return static_cast<int>(graph().tensors.size()) - 1;
  }

  tflite::ModelT model_;
};

/// A network of several operators: 1x1 convolution with float16 and sparse weights, pooling, padding, concatenation.
inline std::string mixed_network() {
  using Op = tflite::BuiltinOperator;
  SmallModel model;
  const int in = model.tensor({1, 4, 4, 2}), convolved = model.tensor({1, 4, 4, 2}),
            pooled = model.tensor({1, 2, 2, 2});
  const int padded = model.tensor({1, 2, 2, 4}), flat = model.tensor({1, 16}), out = model.tensor({1, 32});
  const int sparse = model.halves({2, 1, 1, 2}, {0x3c00, 0xc000});  // 1 and -2
  auto sparsity = std::make_unique<tflite::SparsityParametersT>();
  sparsity->traversal_order = {0, 1, 2, 3};
  for (const int size : {2, 1, 1}) {
    auto axis = std::make_unique<tflite::DimensionMetadataT>();
    axis->dense_size = size;
    sparsity->dim_metadata.push_back(std::move(axis));
  }
  auto last = std::make_unique<tflite::DimensionMetadataT>();
  last->format = tflite::DimensionType::SPARSE_CSR;
  tflite::Uint16VectorT segments;
  segments.values = {0, 1, 2};
  tflite::Uint8VectorT indices;
  indices.values = {1, 0};
  last->array_segments.Set(segments);
  last->array_indices.Set(indices);
  sparsity->dim_metadata.push_back(std::move(last));
  model.stored(sparse).sparsity = std::move(sparsity);
  const int dense = model.tensor({2, 1, 1, 2}), weights = model.tensor({2, 1, 1, 2}),
            bias = model.constant({2}, {0, 10});
  model.step(Op::DENSIFY, {sparse}, dense);
  model.step(Op::DEQUANTIZE, {dense}, weights);
  tflite::Conv2DOptionsT conv;
  conv.stride_w = conv.stride_h = 1;
  model.step(Op::CONV_2D, {in, weights, bias}, convolved, conv);
  tflite::Pool2DOptionsT pool;
  pool.stride_w = pool.stride_h = pool.filter_width = pool.filter_height = 2;
  model.step(Op::MAX_POOL_2D, {convolved}, pooled, pool);
  model.step(Op::PAD, {pooled, model.integers({4, 2}, {0, 0, 0, 0, 0, 0, 0, 2})}, padded);
  model.step(Op::RESHAPE, {padded}, flat);
  tflite::ConcatenationOptionsT concatenation;
  concatenation.axis = 1;
  model.step(Op::CONCATENATION, {flat, flat}, out, concatenation);
  return model.file({in}, {out});
}

/// The mean over rows and columns of a sum of images with other negative values, and a product with weights.
inline std::string mean_and_product_network() {
  using Op = tflite::BuiltinOperator;
  SmallModel model;
  const int in = model.tensor({1, 2, 2, 2}), sum = model.tensor({1, 2, 2, 2}), bent = model.tensor({1, 2, 2, 2}),
            mean = model.tensor({1, 2}), out = model.tensor({1, 3});
  model.step(Op::ADD, {in, model.constant({1, 2, 2, 2}, std::vector<float>(8, 1.0f))}, sum, tflite::AddOptionsT());
  model.step(Op::PRELU, {sum, model.constant({1, 1, 2}, {0.5f, 0.25f})}, bent);
  model.step(Op::MEAN, {bent, model.integers({2}, {1, 2})}, mean);
  model.step(Op::FULLY_CONNECTED, {mean, model.constant({3, 2}, {1, 2, 3, 4, 5, 6}), model.constant({3}, {0, 1, 2})},
             out, tflite::FullyConnectedOptionsT());
  return model.file({in}, {out});
}

}  // namespace doppel::support
