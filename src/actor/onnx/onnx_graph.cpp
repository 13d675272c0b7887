#include "doppel/actor/onnx/onnx_graph.h"

#include <onnx/checker.h>
#include <onnx/onnx_pb.h>

#include <set>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr int kOpset = 17, kIrVersion = 8;
constexpr std::size_t kMaxFileBytes = (std::size_t{1} << 31) - 1;

onnx::TensorProto_DataType onnx_type(torch::ScalarType type) {
  switch (type) {
    case torch::kFloat32:
      return onnx::TensorProto::FLOAT;
    case torch::kFloat64:
      return onnx::TensorProto::DOUBLE;
    case torch::kInt32:
      return onnx::TensorProto::INT32;
    case torch::kInt64:
      return onnx::TensorProto::INT64;
    case torch::kBool:
      return onnx::TensorProto::BOOL;
    case torch::kUInt8:
      return onnx::TensorProto::UINT8;
    case torch::kInt8:
      return onnx::TensorProto::INT8;
    case torch::kFloat16:
      return onnx::TensorProto::FLOAT16;
    default:
      fail("writing ONNX: tensors of type {} are not supported", c10::toString(type));
  }
}

void set_type(onnx::ValueInfoProto& info, torch::ScalarType type, const std::vector<std::int64_t>& sizes) {
  onnx::TypeProto_Tensor* tensor = info.mutable_type()->mutable_tensor_type();
  tensor->set_elem_type(onnx_type(type));
  tensor->mutable_shape();
  for (const std::int64_t size : sizes) {
    if (size < 0)
      tensor->mutable_shape()->add_dim()->set_dim_param("batch");
    else
      tensor->mutable_shape()->add_dim()->set_dim_value(size);
  }
}

/// @param value on the CPU, contiguous
onnx::TensorProto tensor_proto(const torch::Tensor& value) {
  onnx::TensorProto tensor;
  tensor.set_data_type(onnx_type(value.scalar_type()));
  for (const std::int64_t size : value.sizes()) tensor.add_dims(size);
  tensor.set_raw_data(value.data_ptr(), value.nbytes());
  return tensor;
}

struct AttributeWriter {
  onnx::AttributeProto& attribute;
  void operator()(std::int64_t value) const {
    attribute.set_type(onnx::AttributeProto::INT);
    attribute.set_i(value);
  }
  void operator()(double value) const {
    attribute.set_type(onnx::AttributeProto::FLOAT);
    attribute.set_f(static_cast<float>(value));
  }
  void operator()(const std::string& value) const {
    attribute.set_type(onnx::AttributeProto::STRING);
    attribute.set_s(value);
  }
  void operator()(const std::vector<std::int64_t>& values) const {
    attribute.set_type(onnx::AttributeProto::INTS);
    for (const std::int64_t value : values) attribute.add_ints(value);
  }
};

}  // namespace

OnnxGraph::OnnxGraph() : model_(std::make_unique<onnx::ModelProto>()) {
  model_->set_ir_version(kIrVersion);
  model_->set_producer_name("doppel");
  model_->add_opset_import()->set_version(kOpset);
}

OnnxGraph::~OnnxGraph() = default;

void OnnxGraph::add_input(const std::string& name, torch::ScalarType type, const std::vector<std::int64_t>& sizes) {
  onnx::ValueInfoProto* input = model_->mutable_graph()->add_input();
  input->set_name(name);
  set_type(*input, type, sizes);
}

void OnnxGraph::add_output(const std::string& name, const std::string& value, torch::ScalarType type,
                           const std::vector<std::int64_t>& sizes) {
  onnx::NodeProto* node = model_->mutable_graph()->add_node();
  node->set_op_type("Identity");
  node->add_input(value);
  node->add_output(name);
  onnx::ValueInfoProto* output = model_->mutable_graph()->add_output();
  output->set_name(name);
  set_type(*output, type, sizes);
}

std::string OnnxGraph::add(const char* op, const std::vector<std::string>& inputs, const OnnxAttributes& attributes) {
  onnx::NodeProto node;
  node.set_op_type(op);
  for (const std::string& input : inputs) node.add_input(input);
  for (const auto& [name, value] : attributes) {
    onnx::AttributeProto* attribute = node.add_attribute();
    attribute->set_name(name);
    std::visit(AttributeWriter{*attribute}, value);
  }
  const auto [known, is_new] = known_.try_emplace(node.SerializeAsString());
  if (is_new) {
    known->second = fmt::format("{}_{}", op, next_++);
    node.add_output(known->second);
    *model_->mutable_graph()->add_node() = std::move(node);
  }
  return known->second;
}

std::string OnnxGraph::constant(const torch::Tensor& value) {
  const torch::Tensor plain = value.detach().cpu().contiguous();
  onnx::TensorProto tensor = tensor_proto(plain);
  // Large constants are compared by their hash and size: a map of their bytes would hold every weight twice.
  std::string key = tensor.SerializeAsString();
  if (key.size() > 4096)
    key = fmt::format("{} {} {}", plain.nbytes(), std::hash<std::string>()(key), c10::toString(plain.scalar_type()));
  const auto [known, is_new] = known_.try_emplace(key);
  if (is_new) {
    known->second = fmt::format("constant_{}", next_++);
    tensor.set_name(known->second);
    *model_->mutable_graph()->add_initializer() = std::move(tensor);
  }
  return known->second;
}

std::string OnnxGraph::parameter(const std::string& name, const torch::Tensor& value) {
  if (!known_.try_emplace("parameter " + name, name).second) return name;
  onnx::TensorProto tensor = tensor_proto(value.detach().cpu().contiguous());
  tensor.set_name(name);
  *model_->mutable_graph()->add_initializer() = std::move(tensor);
  return name;
}

std::string OnnxGraph::integers(const std::vector<std::int64_t>& values) {
  return constant(torch::tensor(values, torch::kInt64));
}

std::string OnnxGraph::number(double value, torch::ScalarType type) {
  return constant(torch::scalar_tensor(value, torch::TensorOptions().dtype(type)));
}

std::string OnnxGraph::cast(const std::string& value, torch::ScalarType type) {
  return add("Cast", {value}, {{"to", std::int64_t{onnx_type(type)}}});
}

void OnnxGraph::remove_unused() {
  onnx::GraphProto& graph = *model_->mutable_graph();
  std::set<std::string> used;
  for (const auto& output : graph.output()) used.insert(output.name());
  std::vector<onnx::NodeProto> nodes;
  for (int i = graph.node_size(); i-- > 0;) {  // the operators stand in order, so users come after what they use
    onnx::NodeProto& node = *graph.mutable_node(i);
    if (!used.contains(node.output(0))) continue;
    used.insert(node.input().begin(), node.input().end());
    nodes.push_back(std::move(node));
  }
  graph.clear_node();
  for (auto node = nodes.rbegin(); node != nodes.rend(); ++node) *graph.add_node() = std::move(*node);
  std::vector<onnx::TensorProto> constants;
  for (auto& tensor : *graph.mutable_initializer())
    if (used.contains(tensor.name())) constants.push_back(std::move(tensor));
  graph.clear_initializer();
  for (auto& tensor : constants) *graph.add_initializer() = std::move(tensor);
}

std::string OnnxGraph::bytes(const std::string& name, const std::map<std::string, std::string>& metadata) {
  remove_unused();
  model_->mutable_graph()->set_name(name);
  for (const auto& [key, value] : metadata) {
    auto* pair = model_->add_metadata_props();
    pair->set_key(key);
    pair->set_value(value);
  }
  if (model_->ByteSizeLong() > kMaxFileBytes)
    fail("writing ONNX: the model of {} needs {:.1f} GB, a file holds at most 2 GB; --format torchscript has no limit",
         name, static_cast<double>(model_->ByteSizeLong()) / 1e9);
  try {
    onnx::checker::check_model(*model_);
  } catch (const std::exception& e) {
    fail("writing ONNX: the checker of the ONNX library refuses the model of {}: {}", name, e.what());
  }
  return model_->SerializeAsString();
}

}  // namespace doppel
