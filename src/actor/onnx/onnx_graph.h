#pragma once

#include <torch/types.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace onnx {
class ModelProto;
}

namespace doppel {

/// Attributes of an ONNX operator, by name.
using OnnxAttributes =
    std::vector<std::pair<const char*, std::variant<std::int64_t, double, std::string, std::vector<std::int64_t>>>>;

/// An ONNX model that grows operator by operator. Values are named by strings, as in the file. Equal operators on equal
/// inputs become one, and so do equal constants.
class OnnxGraph {
 public:
  OnnxGraph();
  OnnxGraph(const OnnxGraph&) = delete;
  OnnxGraph& operator=(const OnnxGraph&) = delete;
  ~OnnxGraph();

  /// @param sizes a dimension of -1 is the batch, which is called `batch`
  void add_input(const std::string& name, torch::ScalarType type, const std::vector<std::int64_t>& sizes);
  /// Makes `value` an output of the model. `type` and `sizes` are those of the value.
  void add_output(const std::string& name, const std::string& value, torch::ScalarType type,
                  const std::vector<std::int64_t>& sizes);

  /// @return the name of the result, which is the first and only output of the operator
  std::string add(const char* op, const std::vector<std::string>& inputs, const OnnxAttributes& attributes = {});

  /// A constant, stored in the file. @throws Error for a type that ONNX does not have
  std::string constant(const torch::Tensor& value);
  /// A constant that keeps the name of a parameter. One name stands for one tensor.
  std::string parameter(const std::string& name, const torch::Tensor& value);
  /// One-dimensional int64.
  std::string integers(const std::vector<std::int64_t>& values);
  /// Zero-dimensional.
  std::string number(double value, torch::ScalarType type);
  std::string cast(const std::string& value, torch::ScalarType type);

  /// The model as the bytes of a file: opset 17, IR version 8, without operators that lead to no output. `metadata` is
  /// kept as the file's key-value pairs. @throws Error when the file would be larger than 2 GB, protobuf's limit, or
  /// when the ONNX library's checker finds a fault
  std::string bytes(const std::string& name, const std::map<std::string, std::string>& metadata);

 private:
  void remove_unused();

  std::unique_ptr<onnx::ModelProto> model_;
  std::map<std::string, std::string> known_;  ///< operator or constant, as bytes -> the name of its result
  std::int64_t next_ = 0;
};

}  // namespace doppel
