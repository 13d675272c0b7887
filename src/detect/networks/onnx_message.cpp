#include "doppel/detect/networks/onnx_message.h"

#include <algorithm>
#include <cstring>

#include "doppel/core/as_size.h"

namespace doppel::onnx {

namespace {

enum NodeField { kNodeInput = 1, kNodeOutput = 2, kNodeName = 3, kNodeType = 4, kNodeAttribute = 5 };
enum AttributeField { kAttributeName = 1, kFloat = 2, kInteger = 3, kTensor = 5, kIntegers = 8, kAttributeType = 20 };
enum TensorField { kDims = 1, kDataType = 2, kFloats = 4, kLongs = 7, kTensorName = 8, kRaw = 9 };
constexpr std::uint64_t kFloatType = 1, kLongType = 7;  ///< of tensors; the first one also of attributes

enum WireType { kVarint = 0, kEightBytes = 1, kBytes = 2, kFourBytes = 5 };

std::uint64_t take_varint(std::string_view& rest) {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    if (rest.empty()) throw NoMessage();
    const auto byte = static_cast<unsigned char>(rest.front());
    rest.remove_prefix(1);
    value |= static_cast<std::uint64_t>(byte & 127u) << shift;
    if (byte < 128) return value;
  }
  throw NoMessage();
}

Field take_field(std::string_view& rest) {
  const std::string_view start = rest;
  const std::uint64_t tag = take_varint(rest);
  const auto type = static_cast<int>(tag & 7u);
  Field field;
  field.id = static_cast<int>(tag >> 3);
  field.has_bytes = type == kBytes;
  std::string_view content = rest;
  std::uint64_t size = type == kEightBytes ? 8 : 4;
  if (type == kVarint) {
    field.number = take_varint(rest);
    size = content.size() - rest.size();
  } else if (type == kBytes) {
    size = take_varint(rest);
    content = rest;
  } else if (type != kEightBytes && type != kFourBytes) {
    throw NoMessage();
  }
  if (size > content.size()) throw NoMessage();
  field.bytes = content.substr(0, size);
  rest = content.substr(size);
  field.whole = start.substr(0, start.size() - rest.size());
  return field;
}

void append_varint(std::string& to, std::uint64_t value) {
  for (; value >= 128; value >>= 7) to += static_cast<char>((value & 127u) | 128u);
  to += static_cast<char>(value);
}

void append_number(std::string& to, int id, std::uint64_t value) {
  append_varint(to, static_cast<std::uint64_t>(id) << 3 | kVarint);
  append_varint(to, value);
}

/// Varints of a repeated field, one by one or packed.
void add_varints(const Field& field, std::vector<std::int64_t>& to) {
  if (!field.has_bytes) return to.push_back(static_cast<std::int64_t>(field.number));
  for (std::string_view rest = field.bytes; !rest.empty();) to.push_back(static_cast<std::int64_t>(take_varint(rest)));
}

/// Numbers of fixed size, packed or raw.
template <typename T>
void add_values(std::string_view bytes, std::vector<T>& to) {
  const std::size_t before = to.size(), count = bytes.size() / sizeof(T);
  to.resize(before + count);
  if (count > 0) std::memcpy(to.data() + before, bytes.data(), count * sizeof(T));
}

/// Whether dimensions have that many elements. Their product may be too large for any integer.
bool has_elements(const std::vector<std::int64_t>& dims, std::size_t values) {
  if (!dims.empty() && *std::min_element(dims.begin(), dims.end()) < 1)
    return values == 0 && *std::min_element(dims.begin(), dims.end()) == 0;
  std::size_t count = 1;
  for (const std::int64_t size : dims) {
    if (count > values / as_size(size)) return false;
    count *= as_size(size);
  }
  return count == values;
}

std::string_view text_of(std::string_view message, int id) {
  for (const Field& field : fields_of(message))
    if (field.id == id && field.has_bytes) return field.bytes;
  return {};
}

}  // namespace

std::vector<Field> fields_of(std::string_view message) {
  std::vector<Field> fields;
  while (!message.empty()) fields.push_back(take_field(message));
  return fields;
}

void append_bytes(std::string& to, int id, std::string_view bytes) {
  append_varint(to, static_cast<std::uint64_t>(id) << 3 | kBytes);
  append_varint(to, bytes.size());
  to += bytes;
}

std::optional<Tensor> read_tensor(std::string_view message) {
  Tensor tensor;
  std::uint64_t type = 0;
  std::string_view raw;
  for (const Field& field : fields_of(message)) {
    if (field.id == kDims) add_varints(field, tensor.dims);
    if (field.id == kDataType) type = field.number;
    if (field.id == kFloats) add_values(field.bytes, tensor.floats);
    if (field.id == kLongs) add_varints(field, tensor.integers);
    if (field.id == kRaw) raw = field.bytes;
  }
  if (type == kFloatType) add_values(raw, tensor.floats);
  if (type == kLongType) add_values(raw, tensor.integers);
  const std::size_t values = tensor.floats.size() + tensor.integers.size();
  const bool whole = (type == kFloatType && tensor.integers.empty() && has_elements(tensor.dims, values)) ||
                     (type == kLongType && tensor.floats.empty() && has_elements(tensor.dims, values));
  return whole ? std::optional(std::move(tensor)) : std::nullopt;
}

std::string write_tensor(const std::string& name, const Tensor& tensor) {
  std::string text;
  for (const std::int64_t size : tensor.dims) append_number(text, kDims, static_cast<std::uint64_t>(size));
  append_number(text, kDataType, tensor.integers.empty() ? kFloatType : kLongType);
  append_bytes(text, kTensorName, name);
  const auto raw = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  append_bytes(text, kRaw, tensor.integers.empty() ? raw(tensor.floats) : raw(tensor.integers));
  return text;
}

std::optional<std::vector<std::int64_t>> Node::integers(const std::string& attribute) const {
  for (const std::string& message : attributes) {
    if (text_of(message, kAttributeName) != attribute) continue;
    std::vector<std::int64_t> values;
    for (const Field& field : fields_of(message))
      if (field.id == kIntegers || field.id == kInteger) add_varints(field, values);
    return values;
  }
  return std::nullopt;
}

void Node::add_number(const std::string& attribute, float value) {
  std::string text;
  append_bytes(text, kAttributeName, attribute);
  append_varint(text, kFloat << 3 | kFourBytes);
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  text.append(raw, sizeof raw);
  append_number(text, kAttributeType, kFloatType);
  attributes.push_back(std::move(text));
}

Node read_node(std::string_view message) {
  Node node;
  for (const Field& field : fields_of(message)) {
    const std::string text(field.bytes);
    if (field.id == kNodeInput) node.inputs.push_back(text);
    if (field.id == kNodeOutput) node.outputs.push_back(text);
    if (field.id == kNodeName) node.name = text;
    if (field.id == kNodeType) node.type = text;
    if (field.id == kNodeAttribute) node.attributes.push_back(text);
  }
  return node;
}

std::string write_node(const Node& node) {
  std::string text;
  for (const std::string& input : node.inputs) append_bytes(text, kNodeInput, input);
  for (const std::string& output : node.outputs) append_bytes(text, kNodeOutput, output);
  append_bytes(text, kNodeName, node.name);
  append_bytes(text, kNodeType, node.type);
  for (const std::string& attribute : node.attributes) append_bytes(text, kNodeAttribute, attribute);
  return text;
}

std::map<std::string, std::string_view> constants_of(std::string_view graph) {
  std::map<std::string, std::string_view> constants;
  for (const Field& part : fields_of(graph)) {
    if (part.id == kInitializer) constants.emplace(text_of(part.bytes, kTensorName), part.bytes);
    if (part.id == kNode && text_of(part.bytes, kNodeType) == "Constant")
      constants.emplace(text_of(part.bytes, kNodeOutput), text_of(text_of(part.bytes, kNodeAttribute), kTensor));
  }
  return constants;
}

}  // namespace doppel::onnx
