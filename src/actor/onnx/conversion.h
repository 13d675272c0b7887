#pragma once

/// Conversion of one TorchScript operation into ONNX operators. To add an operation, write its function in the file of
/// its subject (conversions/) and add a line to that file's table.

#include <torch/script.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "doppel/actor/onnx/onnx_graph.h"

namespace doppel {

/// A value of the TorchScript graph during conversion.
struct OnnxValue {
  bool constant = false;
  std::vector<torch::jit::IValue> samples;  ///< one per sample; a constant has one. Tensors are freed after their use
  std::vector<OnnxValue> items;             ///< of a list of tensors that depend on the inputs
  std::string name;                         ///< in the ONNX graph; empty for constants
  torch::ScalarType type = torch::kFloat32;
  std::vector<std::int64_t> sizes;  ///< of a tensor; -1 where the samples differ
};

/// One operation: its arguments and result.
class OnnxOperation {
 public:
  OnnxOperation(OnnxGraph& onnx, std::string op, std::vector<OnnxValue> arguments, OnnxValue expected)
      : graph(onnx), name(std::move(op)), arguments_(std::move(arguments)), result_(std::move(expected)) {}

  OnnxGraph& graph;
  const std::string name;  ///< for messages: "aten::mul"

  std::size_t size() const { return arguments_.size(); }
  bool is_none(std::size_t i) const;

  // Constants. @throws Error when the argument depends on the inputs
  const torch::jit::IValue& constant(std::size_t i) const;
  double number(std::size_t i) const;
  std::int64_t integer(std::size_t i) const;
  bool flag(std::size_t i) const;
  std::vector<std::int64_t> integers(std::size_t i) const;

  // Tensors. A number counts as a tensor of dimension 0.
  torch::ScalarType type(std::size_t i) const;
  const std::vector<std::int64_t>& sizes(std::size_t i) const;
  std::int64_t rank(std::size_t i) const { return static_cast<std::int64_t>(sizes(i).size()); }
  std::string tensor(std::size_t i) const;
  /// The argument in another type.
  std::string tensor(std::size_t i, torch::ScalarType type) const;
  std::vector<std::string> tensors(std::size_t i) const;  ///< a list, in the result's type
  /// Argument i as a dimension of argument 0, 0 or more.
  std::int64_t dimension(std::size_t i) const;

  /// Argument i as a dimension of the result, 0 or more.
  std::int64_t result_dimension(std::size_t i) const;

  torch::ScalarType result_type() const { return result_.type; }
  const std::vector<std::int64_t>& result_sizes() const { return result_.sizes; }

  /// `value` in the shape of the result. @throws Error when more than one size follows the batch
  std::string reshaped(const std::string& value) const;
  [[noreturn]] void unsupported(const std::string& what) const;

 private:
  std::vector<OnnxValue> arguments_;
  OnnxValue result_;
};

using OnnxConversion = std::string (*)(const OnnxOperation&);
using OnnxConversionTable = std::vector<std::pair<const char*, OnnxConversion>>;

/// The conversion of an operation such as "aten::mul", or null.
OnnxConversion find_onnx_conversion(const std::string& name);

// The tables, one a file of conversions/.
const OnnxConversionTable& arithmetic_conversions();
const OnnxConversionTable& shape_conversions();
const OnnxConversionTable& indexing_conversions();
const OnnxConversionTable& reduction_conversions();
const OnnxConversionTable& matrix_conversions();
const OnnxConversionTable& network_conversions();

}  // namespace doppel
