#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

/// Writes small networks in ONNX format.
namespace doppel::support {

/// Just enough of the protocol buffers' wire format to write a network.
namespace wire {

inline std::string number(std::uint64_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) bytes += static_cast<char>((value & 127) | 128);
  return bytes + static_cast<char>(value);
}
inline std::string field(int id, std::uint64_t value) { return number(8u * static_cast<unsigned>(id)) + number(value); }
inline std::string field(int id, const std::string& bytes) {
  return number(8u * static_cast<unsigned>(id) + 2) + number(bytes.size()) + bytes;
}
template <typename T>
std::string raw(const std::vector<T>& values) {
  return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

}  // namespace wire

/// Usage:
/// @code
///   OnnxFile net;
///   net.input("image", {1, 3, 8, 8}).output("sum", {1, 1, 8, 8}).floats("w", {1, 3, 1, 1}, {1, 1, 1});
///   net.node("Conv", {"image", "w"}, {"sum"}, {OnnxFile::ints("kernel_shape", {1, 1})});
///   write_bytes(folder / "net.onnx", net.bytes());
/// @endcode
class OnnxFile {
 public:
  using Shape = std::vector<int>;

  static std::string ints(const std::string& name, const std::vector<int>& values) {
    std::string text = wire::field(1, name) + wire::field(20, 7);
    for (const int value : values) text += wire::field(8, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
    return text;
  }
  static std::string integer(const std::string& name, int value) {
    return wire::field(1, name) + wire::field(20, 2) +
           wire::field(3, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
  }

  OnnxFile& input(const std::string& name, const Shape& shape) { return add(11, value(name, shape)); }
  OnnxFile& output(const std::string& name, const Shape& shape) { return add(12, value(name, shape)); }
  OnnxFile& floats(const std::string& name, const Shape& shape, const std::vector<float>& values) {
    return add(5, tensor(name, shape, 1, wire::raw(values)));
  }
  OnnxFile& integers(const std::string& name, const std::vector<std::int64_t>& values) {
    return add(5, tensor(name, {static_cast<int>(values.size())}, 7, wire::raw(values)));
  }
  /// A node that is a single number.
  OnnxFile& number_node(const std::string& name, float value) {
    const std::string attribute = wire::field(1, std::string("value")) +
                                  wire::field(5, tensor("", {}, 1, wire::raw<float>({value}))) + wire::field(20, 4);
    return node("Constant", {}, {name}, {attribute});
  }
  /// @param attributes of `ints` and `integer`
  OnnxFile& node(const std::string& type, const std::vector<std::string>& inputs,
                 const std::vector<std::string>& outputs, const std::vector<std::string>& attributes = {}) {
    std::string text;
    for (const std::string& name : inputs) text += wire::field(1, name);
    for (const std::string& name : outputs) text += wire::field(2, name);
    text += wire::field(3, "make_" + outputs.at(0)) + wire::field(4, type);
    for (const std::string& attribute : attributes) text += wire::field(5, attribute);
    return add(1, text);
  }

  std::string bytes() const {
    return wire::field(1, std::uint64_t{7}) + wire::field(7, graph_ + wire::field(2, std::string("net"))) +
           wire::field(8, wire::field(2, std::uint64_t{11}));
  }

 private:
  static std::string value(const std::string& name, const Shape& shape) {
    std::string dims;
    for (const int size : shape) dims += wire::field(1, wire::field(1, static_cast<std::uint64_t>(size)));
    return wire::field(1, name) +
           wire::field(2, wire::field(1, wire::field(1, std::uint64_t{1}) + wire::field(2, dims)));
  }
  static std::string tensor(const std::string& name, const Shape& shape, std::uint64_t type, const std::string& bytes) {
    std::string text;
    for (const int size : shape) text += wire::field(1, static_cast<std::uint64_t>(size));
    return text + wire::field(2, type) + wire::field(8, name) + wire::field(9, bytes);
  }
  OnnxFile& add(int id, const std::string& part) {
    graph_ += wire::field(id, part);
    return *this;
  }

  std::string graph_;
};

}  // namespace doppel::support
