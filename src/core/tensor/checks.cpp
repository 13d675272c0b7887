#include "doppel/core/tensor/checks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {
namespace {

bool has_shape(const torch::Tensor& tensor, torch::IntArrayRef shape) {
  return tensor.defined() && std::equal(shape.begin(), shape.end(), tensor.sizes().begin(), tensor.sizes().end(),
                                        [](int64_t allowed, int64_t size) { return allowed < 0 || size == allowed; });
}

/// `[B,K,3] = [any,16,3]`, or the sizes alone.
std::string shape_text(torch::IntArrayRef shape, const std::string& letters) {
  std::vector<std::string> sizes;
  for (const int64_t size : shape) sizes.push_back(size < 0 ? "any" : std::to_string(size));
  const std::string numbers = fmt::format("[{}]", fmt::join(sizes, ","));
  return letters.empty() || letters == numbers ? numbers : letters + " = " + numbers;
}

}  // namespace

std::string name_of(torch::ScalarType type) {
  switch (type) {
    case torch::kFloat16:
      return "float16";
    case torch::kFloat32:
      return "float32";
    case torch::kFloat64:
      return "float64";
    case torch::kUInt8:
      return "uint8";
    case torch::kInt8:
      return "int8";
    case torch::kInt16:
      return "int16";
    case torch::kInt32:
      return "int32";
    case torch::kInt64:
      return "int64";
    case torch::kBool:
      return "bool";
    default:
      return torch::toString(type);
  }
}

std::string describe(const torch::Tensor& tensor) {
  if (!tensor.defined()) return "an undefined tensor";
  const std::string device = tensor.device().is_cpu() ? "" : " on " + tensor.device().str();
  return fmt::format("{} [{}]{}", name_of(tensor.scalar_type()), fmt::join(tensor.sizes(), ","), device);
}

void check_tensor(const char* op, const char* argument, const torch::Tensor& tensor,
                  at::ArrayRef<torch::ScalarType> types, torch::IntArrayRef shape, const char* letters) {
  if (has_shape(tensor, shape) && std::count(types.begin(), types.end(), tensor.scalar_type()) > 0) return;
  std::vector<std::string> names;
  for (const torch::ScalarType type : types) names.push_back(name_of(type));
  fail<UsageError>("{}: {} must be {} {}, found {}", op, argument, fmt::join(names, " or "), shape_text(shape, letters),
                   describe(tensor));
}

void check_shape(const char* op, const char* argument, const torch::Tensor& tensor, torch::IntArrayRef shape,
                 const char* letters) {
  if (has_shape(tensor, shape) && tensor.is_floating_point()) return;
  fail<UsageError>("{}: {} must be a floating-point tensor {}, found {}", op, argument, shape_text(shape, letters),
                   describe(tensor));
}

void check_floats(const char* op, const char* argument, const torch::Tensor& tensor, torch::IntArrayRef shape,
                  const char* letters) {
  check_tensor(op, argument, tensor, {torch::kFloat32}, shape, letters);
  if (!tensor.device().is_cpu())
    fail<UsageError>("{}: {} is on {}; it must be on the CPU", op, argument, tensor.device().str());
}

void check_same_kind(const char* op, const char* argument, const torch::Tensor& tensor, const torch::Tensor& like) {
  if (tensor.scalar_type() != like.scalar_type() || tensor.device() != like.device()) {
    fail<UsageError>("{}: {} is {} on {}, the other arguments are {} on {}; convert it with .to()", op, argument,
                     name_of(tensor.scalar_type()), tensor.device().str(), name_of(like.scalar_type()),
                     like.device().str());
  }
}

}  // namespace doppel
