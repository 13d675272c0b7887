#include "doppel/actor/onnx/conversion.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "doppel/core/error.h"

namespace doppel {
namespace {

torch::Tensor tensor_of_constant(const torch::jit::IValue& value) {
  if (value.isTensor()) return value.toTensor();
  if (value.isInt()) return torch::scalar_tensor(value.toInt(), torch::kInt64);
  if (value.isBool()) return torch::scalar_tensor(value.toBool(), torch::kBool);
  return torch::scalar_tensor(value.toDouble(), torch::kFloat64);
}

}  // namespace

void OnnxOperation::unsupported(const std::string& what) const {
  fail("writing ONNX: {} {}, which has no conversion; --format torchscript writes every model", name, what);
}

bool OnnxOperation::is_none(std::size_t i) const {
  return i >= arguments_.size() || (arguments_[i].constant && arguments_[i].samples.front().isNone());
}

const torch::jit::IValue& OnnxOperation::constant(std::size_t i) const {
  if (!arguments_.at(i).constant) unsupported(fmt::format("has an argument {} that depends on the inputs", i + 1));
  return arguments_[i].samples.front();
}

double OnnxOperation::number(std::size_t i) const {
  const torch::jit::IValue& value = constant(i);
  return value.isTensor() ? value.toTensor().item<double>() : value.toScalar().toDouble();
}

std::int64_t OnnxOperation::integer(std::size_t i) const { return constant(i).toInt(); }

bool OnnxOperation::flag(std::size_t i) const { return constant(i).toBool(); }

std::vector<std::int64_t> OnnxOperation::integers(std::size_t i) const {
  const torch::jit::IValue& value = constant(i);
  if (value.isInt()) return {value.toInt()};
  return value.toIntVector();
}

torch::ScalarType OnnxOperation::type(std::size_t i) const {
  const OnnxValue& value = arguments_.at(i);
  return value.constant ? tensor_of_constant(value.samples.front()).scalar_type() : value.type;
}

const std::vector<std::int64_t>& OnnxOperation::sizes(std::size_t i) const { return arguments_.at(i).sizes; }

std::string OnnxOperation::tensor(std::size_t i) const { return tensor(i, type(i)); }

std::string OnnxOperation::tensor(std::size_t i, torch::ScalarType wanted) const {
  const OnnxValue& value = arguments_.at(i);
  if (value.constant) return graph.constant(tensor_of_constant(value.samples.front()).to(wanted));
  return value.type == wanted ? value.name : graph.cast(value.name, wanted);
}

std::vector<std::string> OnnxOperation::tensors(std::size_t i) const {
  std::vector<std::string> names;
  for (const OnnxValue& item : arguments_.at(i).items)
    names.push_back(item.constant               ? graph.constant(item.samples.front().toTensor().to(result_.type))
                    : item.type == result_.type ? item.name
                                                : graph.cast(item.name, result_.type));
  return names;
}

std::int64_t OnnxOperation::dimension(std::size_t i) const {
  const std::int64_t found = integer(i);
  return found < 0 ? found + rank(0) : found;
}

std::int64_t OnnxOperation::result_dimension(std::size_t i) const {
  const std::int64_t found = integer(i);
  return found < 0 ? found + static_cast<std::int64_t>(result_.sizes.size()) : found;
}

std::string OnnxOperation::reshaped(const std::string& value) const {
  if (std::count(result_.sizes.begin(), result_.sizes.end(), -1) > 1)
    unsupported(
        fmt::format("gives a tensor [{}], in which several sizes follow the batch", fmt::join(result_.sizes, ", ")));
  return graph.add("Reshape", {value, graph.integers(result_.sizes)});
}

OnnxConversion find_onnx_conversion(const std::string& name) {
  static const std::map<std::string, OnnxConversion> all = [] {
    std::map<std::string, OnnxConversion> table;
    for (const OnnxConversionTable* part : {&arithmetic_conversions(), &shape_conversions(), &indexing_conversions(),
                                            &reduction_conversions(), &matrix_conversions(), &network_conversions()})
      table.insert(part->begin(), part->end());
    return table;
  }();
  const auto found = all.find(name);
  return found == all.end() ? nullptr : found->second;
}

}  // namespace doppel
