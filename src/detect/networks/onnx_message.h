#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// The parts of onnx.proto that edits of networks need, on the bytes of a file. Views are valid as long as the bytes.
namespace doppel::onnx {

/// Thrown where bytes are not those of protocol buffers.
struct NoMessage : std::runtime_error {
  NoMessage() : std::runtime_error("no protocol buffer") {}
};

enum ModelField { kGraph = 7 };
enum GraphField { kNode = 1, kInitializer = 5 };

/// A field of a message.
struct Field {
  int id = 0;
  bool has_bytes = false;    ///< text, a message or packed numbers; otherwise one number
  std::uint64_t number = 0;  ///< of a varint
  std::string_view whole;    ///< with the tag
  std::string_view bytes;    ///< without tag and length
};
/// @throws NoMessage
std::vector<Field> fields_of(std::string_view message);
void append_bytes(std::string& to, int id, std::string_view bytes);

/// A constant.
struct Tensor {
  std::vector<std::int64_t> dims;
  std::vector<float> floats;           ///< of 32-bit numbers
  std::vector<std::int64_t> integers;  ///< of 64-bit integers
};
/// @return nothing for other types, and for tensors whose number of values is not that of the dimensions
std::optional<Tensor> read_tensor(std::string_view message);
std::string write_tensor(const std::string& name, const Tensor& tensor);

/// An operator.
struct Node {
  std::string type, name;
  std::vector<std::string> inputs, outputs;
  std::vector<std::string> attributes;  ///< messages

  /// Integers of an attribute. @return nothing when there is no such attribute
  std::optional<std::vector<std::int64_t>> integers(const std::string& attribute) const;
  void add_number(const std::string& attribute, float value);
};
Node read_node(std::string_view message);
std::string write_node(const Node& node);

/// The constants of a graph by name: initializers and nodes `Constant`.
std::map<std::string, std::string_view> constants_of(std::string_view graph);

}  // namespace doppel::onnx
