#include "doppel/io/figure_export/fbx_records.h"

#include <zlib.h>

#include <cstring>
#include <limits>
#include <string_view>

#include "doppel/core/error.h"

namespace doppel {
namespace {

/// Readers of Autodesk check these against the time of creation that the file states (fbx_document.cpp).
constexpr std::string_view kFooterId("\xfa\xbc\xab\x09\xd0\xc8\xd4\x66\xb1\x76\xfb\x83\x1c\xf7\x26\x7e", 16);
constexpr std::string_view kLastBytes("\xf8\x5a\x8c\x6a\xde\xf5\xd9\x7e\xec\xe9\x0c\xe3\x75\x8f\x29\x0b", 16);

class FbxBytesWriter {
 public:
  FbxBytesWriter(int version, bool compressed) : version_(version), compressed_(compressed) {}

  std::string file(const FbxNode& root) {
    file_ = std::string("Kaydara FBX Binary  \0\x1a\0", 23);
    append(static_cast<std::uint32_t>(version_));
    for (const FbxNode& child : root.children) record(child);
    file_.append(empty_record(), '\0');
    footer();
    return std::move(file_);
  }

 private:
  std::size_t width() const { return version_ >= 7500 ? 8 : 4; }
  /// Three lengths and the length of a name, all 0, end a list of records.
  std::size_t empty_record() const { return 3 * width() + 1; }

  template <typename T>
  void append(T value) {
    file_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void put_length(std::size_t at, std::size_t value) {
    if (width() == 4 && value > std::numeric_limits<std::uint32_t>::max())
      fail(
          "the FBX file would be larger than 4 GB, which version 7.4 cannot hold; write fewer frames or morph targets");
    std::memcpy(file_.data() + at, &value, width());
  }

  void record(const FbxNode& node) {
    const std::size_t start = file_.size();
    file_.append(3 * width(), '\0');
    append(static_cast<std::uint8_t>(node.name.size()));
    file_ += node.name;
    const std::size_t first = file_.size();
    for (const FbxNode::Value& value : node.values) std::visit([this](const auto& v) { put(v); }, value);
    put_length(start + width(), node.values.size());
    put_length(start + 2 * width(), file_.size() - first);
    for (const FbxNode& child : node.children) record(child);
    // A record without values is a list, also where the list is empty.
    if (!node.children.empty() || node.values.empty()) file_.append(empty_record(), '\0');
    put_length(start, file_.size());
  }

  void put(std::int32_t value) { scalar('I', value); }
  void put(std::int64_t value) { scalar('L', value); }
  void put(double value) { scalar('D', value); }
  void put(const std::string& value) { text('S', value); }
  void put(const FbxBytes& value) { text('R', value.bytes); }
  void put(const std::vector<float>& values) { list('f', values); }
  void put(const std::vector<double>& values) { list('d', values); }
  void put(const std::vector<std::int32_t>& values) { list('i', values); }
  void put(const std::vector<std::int64_t>& values) { list('l', values); }

  template <typename T>
  void scalar(char type, T value) {
    file_ += type;
    append(value);
  }
  void text(char type, const std::string& value) {
    file_ += type;
    append(static_cast<std::uint32_t>(value.size()));
    file_ += value;
  }

  template <typename T>
  void list(char type, const std::vector<T>& values) {
    const auto* data = reinterpret_cast<const char*>(values.data());
    std::size_t size = sizeof(T) * values.size();
    std::string packed;
    if (compressed_) {
      packed = deflated(data, size);
      data = packed.data();
      size = packed.size();
    }
    file_ += type;
    append(static_cast<std::uint32_t>(values.size()));
    append(static_cast<std::uint32_t>(compressed_));
    append(static_cast<std::uint32_t>(size));
    if (size > 0) file_.append(data, size);
  }

  static std::string deflated(const char* data, std::size_t size) {
    uLongf length = compressBound(size);
    std::string packed(length, '\0');
    if (compress(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(data), size) != Z_OK)
      fail("zlib cannot compress an array of {} bytes", size);
    packed.resize(length);
    return packed;
  }

  void footer() {
    file_ += kFooterId;
    file_.append(16 - file_.size() % 16, '\0');
    file_.append(4, '\0');
    append(static_cast<std::uint32_t>(version_));
    file_.append(120, '\0');
    file_ += kLastBytes;
  }

  int version_;
  bool compressed_;
  std::string file_;
};

}  // namespace

std::string fbx_object_name(const std::string& name, const std::string& kind) {
  return name + std::string("\0\1", 2) + kind;
}

std::string fbx_binary(const FbxNode& root, int version, bool compressed) {
  return FbxBytesWriter(version, compressed).file(root);
}

}  // namespace doppel
