#include "doppel/dnn/onnx_edits.h"

#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace doppel {

namespace {

/// Fields of onnx.proto.
enum ModelField { kGraph = 7 };
enum GraphField { kNode = 1, kInitializer = 5 };
enum NodeField { kInput = 1, kOutput = 2, kOperator = 4, kAttribute = 5 };
enum AttributeField { kName = 1, kFloat = 2, kTensor = 5, kType = 20 };
enum TensorField { kDataType = 2, kFloats = 4, kTensorName = 8, kRaw = 9 };
constexpr std::uint64_t kFloatType = 1;  ///< of tensors and of attributes

enum WireType { kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5 };

/// Thrown where the bytes are not those of protocol buffers.
struct NoMessage : std::runtime_error {
  NoMessage() : std::runtime_error("no protocol buffer") {}
};

/// A field of a message: its bytes with the tag, and its content.
struct Field {
  int id = 0, type = 0;
  std::uint64_t number = 0;       ///< of kVarint
  std::string_view whole, bytes;  ///< `bytes`: without tag and length
};

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
  Field field{static_cast<int>(tag >> 3), static_cast<int>(tag & 7u), 0, {}, {}};
  std::uint64_t size = 0;
  if (field.type == kVarint) {
    const std::string_view before = rest;
    field.number = take_varint(rest);
    size = before.size() - rest.size();
    rest = before;
  } else {
    if (field.type != kFixed64 && field.type != kBytes && field.type != kFixed32) throw NoMessage();
    size = field.type == kBytes ? take_varint(rest) : field.type == kFixed64 ? 8 : 4;
  }
  if (size > rest.size()) throw NoMessage();
  field.bytes = rest.substr(0, size);
  rest.remove_prefix(size);
  field.whole = start.substr(0, start.size() - rest.size());
  return field;
}

std::vector<Field> fields_of(std::string_view message) {
  std::vector<Field> fields;
  while (!message.empty()) fields.push_back(take_field(message));
  return fields;
}

void append_varint(std::string& to, std::uint64_t value) {
  for (; value >= 128; value >>= 7) to += static_cast<char>((value & 127u) | 128u);
  to += static_cast<char>(value);
}

void append_bytes(std::string& to, int id, std::string_view bytes) {
  append_varint(to, static_cast<std::uint64_t>(id) << 3 | kBytes);
  append_varint(to, bytes.size());
  to += bytes;
}

/// A named attribute with a number.
std::string float_attribute(std::string_view name, float value) {
  std::string text;
  append_bytes(text, kName, name);
  append_varint(text, kFloat << 3 | kFixed32);
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  text.append(raw, sizeof raw);
  append_varint(text, kType << 3 | kVarint);
  append_varint(text, kFloatType);
  return text;
}

/// The number of a tensor of one 32-bit number. @return nothing for other tensors
std::optional<float> number_of(std::string_view tensor) {
  std::string_view values;
  bool is_float = false;
  for (const Field& field : fields_of(tensor)) {
    if (field.id == kDataType) is_float = field.number == kFloatType;
    if (field.id == kRaw || field.id == kFloats) values = field.bytes;
  }
  float number = 0.0f;
  if (!is_float || values.size() != sizeof number) return std::nullopt;
  std::memcpy(&number, values.data(), sizeof number);
  return number;
}

std::string_view text_of(std::string_view message, int id) {
  for (const Field& field : fields_of(message))
    if (field.id == id && field.type == kBytes) return field.bytes;
  return {};
}

/// The single numbers among the constants of a graph: initializers, and nodes `Constant`.
std::map<std::string, float, std::less<>> constants_of(std::string_view graph) {
  std::map<std::string, float, std::less<>> constants;
  const auto add = [&](std::string_view name, std::string_view tensor) {
    if (const auto number = number_of(tensor)) constants.emplace(name, *number);
  };
  for (const Field& part : fields_of(graph)) {
    if (part.id == kInitializer) add(text_of(part.bytes, kTensorName), part.bytes);
    if (part.id == kNode && text_of(part.bytes, kOperator) == "Constant")
      add(text_of(part.bytes, kOutput), text_of(text_of(part.bytes, kAttribute), kTensor));
  }
  return constants;
}

/// @return nothing when the node is not to be edited
std::optional<std::string> edited_clip(std::string_view node,
                                       const std::map<std::string, float, std::less<>>& constants) {
  if (text_of(node, kOperator) != "Clip") return std::nullopt;
  std::string text;
  int inputs = 0;
  for (const Field& field : fields_of(node)) {
    if (field.id != kInput || inputs++ == 0) {
      text += field.whole;
      continue;
    }
    if (field.bytes.empty()) continue;  // no limit
    const auto limit = constants.find(field.bytes);
    if (limit == constants.end()) return std::nullopt;
    std::string attribute = float_attribute(inputs == 2 ? "min" : "max", limit->second);
    append_bytes(text, kAttribute, attribute);
  }
  return inputs > 1 ? std::optional(text) : std::nullopt;
}

/// @return nothing when no node is to be edited
std::optional<std::string> edited_graph(std::string_view graph) {
  const auto constants = constants_of(graph);
  std::string text;
  bool edited = false;
  for (const Field& part : fields_of(graph)) {
    const auto clip = part.id == kNode ? edited_clip(part.bytes, constants) : std::nullopt;
    if (clip)
      append_bytes(text, kNode, *clip);
    else
      text += part.whole;
    edited |= clip.has_value();
  }
  return edited ? std::optional(text) : std::nullopt;
}

}  // namespace

std::string with_readable_clips(const std::string& onnx) {
  try {
    std::string text;
    bool edited = false;
    for (const Field& part : fields_of(onnx)) {
      const auto graph = part.id == kGraph && part.type == kBytes ? edited_graph(part.bytes) : std::nullopt;
      if (graph)
        append_bytes(text, kGraph, *graph);
      else
        text += part.whole;
      edited |= graph.has_value();
    }
    return edited ? text : onnx;
  } catch (const NoMessage&) {
    return onnx;  // OpenCV says what is wrong
  }
}

}  // namespace doppel
