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

}  // namespace doppel::support
