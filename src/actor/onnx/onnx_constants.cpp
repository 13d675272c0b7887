#include "doppel/actor/onnx/onnx_constants.h"

#include <onnx/onnx_pb.h>

#include <cstring>
#include <optional>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

std::optional<torch::ScalarType> weight_type(int onnx_type) {
  switch (onnx_type) {
    case onnx::TensorProto::FLOAT:
      return torch::kFloat32;
    case onnx::TensorProto::FLOAT16:
      return torch::kFloat16;
    case onnx::TensorProto::INT8:
      return torch::kInt8;
    default:
      return std::nullopt;
  }
}

}  // namespace

NamedWeights read_onnx_constants(const std::filesystem::path& path) {
  onnx::ModelProto model;
  if (!model.ParseFromString(read_file(path)))
    fail_at({path.string()}, "is not an ONNX model, or is damaged; `doppel export --format onnx` writes them");
  NamedWeights constants;
  for (const onnx::TensorProto& constant : model.graph().initializer()) {
    const std::optional<torch::ScalarType> type = weight_type(constant.data_type());
    if (!type) continue;
    torch::Tensor tensor = torch::empty(std::vector<std::int64_t>(constant.dims().begin(), constant.dims().end()),
                                        torch::TensorOptions().dtype(*type));
    if (constant.raw_data().size() != tensor.nbytes()) continue;
    std::memcpy(tensor.data_ptr(), constant.raw_data().data(), tensor.nbytes());
    constants.emplace_back(constant.name(), tensor);
  }
  return constants;
}

}  // namespace doppel
