#include "doppel/core/npy.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <regex>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/temporary_name.h"

namespace doppel {
namespace {

constexpr char kMagic[] = "\x93NUMPY";
constexpr std::size_t kMagicSize = 6;
// Room for twenty more digits of the first axis, so that a stream can complete its header in place.
constexpr std::size_t kStreamHeaderSize = 256;
constexpr std::size_t kMaxDictionary = 4096;  // bytes of a header that are read

std::int64_t item_size(const std::string& type) {
  if (type == "<f4" || type == "<i4") return 4;
  if (type == "<f8" || type == "<i8") return 8;
  if (type == "|u1") return 1;
  return 0;
}

std::string shape_text(const std::vector<std::int64_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + (shape.size() == 1 ? ",)" : ")");
}

/// The header padded so that the data begins at a multiple of 64 (or at `fixed_size`).
std::string header(const std::string& type, const std::vector<std::int64_t>& shape, std::size_t fixed_size = 0) {
  std::string dictionary = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape_text(shape) + ", }";
  const std::size_t plain = kMagicSize + 4 + dictionary.size() + 1;
  const std::size_t total = fixed_size ? fixed_size : (plain + 63) / 64 * 64;
  dictionary.append(total - plain, ' ');
  dictionary += '\n';
  std::string bytes(kMagic, kMagicSize);
  bytes += '\x01';
  bytes += '\x00';
  bytes += static_cast<char>(dictionary.size() & 0xff);
  bytes += static_cast<char>(dictionary.size() >> 8);
  return bytes + dictionary;
}

std::vector<std::int64_t> parse_shape(const std::string& text, const FileLocation& where) {
  std::vector<std::int64_t> shape;
  const std::regex number("[0-9]+");
  for (std::sregex_iterator it(text.begin(), text.end(), number), end; it != end; ++it) {
    const std::string digits = it->str();
    if (digits.size() > 15) fail_at(where, "the .npy header states an impossible axis of {} items", digits);
    shape.push_back(std::stoll(digits));
  }
  return shape;
}

template <typename Stored, typename T>
std::vector<T> convert(const std::vector<std::uint8_t>& bytes) {
  std::vector<T> values(bytes.size() / sizeof(Stored));
  for (std::size_t i = 0; i < values.size(); ++i) {
    Stored item;
    std::memcpy(&item, bytes.data() + i * sizeof(Stored), sizeof(Stored));
    values[i] = static_cast<T>(item);
    if constexpr (std::is_integral_v<T> && std::is_integral_v<Stored>)
      if (static_cast<Stored>(values[i]) != item)
        fail("a .npy array holds {}, which is no integer of {} bits; save it with smaller numbers", item,
             8 * sizeof(T));
  }
  return values;
}

void write(std::FILE* file, const void* data, std::size_t size, const std::filesystem::path& path) {
  if (size && std::fwrite(data, 1, size, file) != size) fail("writing {}: {}", path.string(), std::strerror(errno));
}

}  // namespace

std::int64_t NpyArray::size() const {
  std::int64_t n = 1;
  for (std::int64_t axis : shape) n *= axis;
  return n;
}

template <typename T>
std::vector<T> NpyArray::as() const {
  const bool floating = type == "<f4" || type == "<f8";
  if (floating && std::is_integral_v<T>) fail("a .npy array of type {} cannot be read as integers", type);
  if constexpr (std::is_floating_point_v<T>) {
    if (type == "<f4") return convert<float, T>(bytes);
    if (type == "<f8") return convert<double, T>(bytes);
  }
  if (type == "<i4") return convert<std::int32_t, T>(bytes);
  if (type == "<i8") return convert<std::int64_t, T>(bytes);
  return convert<std::uint8_t, T>(bytes);
}
template std::vector<float> NpyArray::as<float>() const;
template std::vector<double> NpyArray::as<double>() const;
template std::vector<int> NpyArray::as<int>() const;
template std::vector<std::int64_t> NpyArray::as<std::int64_t>() const;

namespace {

/// Where the items of a file are.
struct Layout {
  std::string type;
  std::vector<std::int64_t> shape;
  std::size_t begin = 0;  ///< of the items, bytes
};

/// @param head the file, or as much of its beginning as the header needs @param size of the file, bytes
Layout parse_header(std::string_view head, std::uint64_t size, const FileLocation& where) {
  const auto byte = [&](std::size_t i) { return as_size(static_cast<unsigned char>(head[i])); };
  if (head.size() < 12 || head.compare(0, kMagicSize, kMagic, kMagicSize) != 0)
    fail_at(where, "is not a .npy file (it does not begin with \\x93NUMPY)");
  const bool first = head[6] == 1;
  if (!first && head[6] != 2) fail_at(where, "is a .npy file of version {}; supported are 1 and 2", byte(6));
  const std::size_t prefix = first ? 10 : 12;
  const std::size_t length = first ? byte(8) | byte(9) << 8 : byte(8) | byte(9) << 8 | byte(10) << 16 | byte(11) << 24;
  if (prefix + length > size) fail_at(where, "ends inside its .npy header");

  const std::string dictionary(head.substr(prefix, std::min<std::size_t>(length, kMaxDictionary)));
  std::smatch descr, shape;
  if (!std::regex_search(dictionary, descr, std::regex("'descr': *'([^']*)'")) ||
      !std::regex_search(dictionary, shape, std::regex("'shape': *\\(([0-9, ]*)\\)")))
    fail_at(where, "has a .npy header without 'descr' or 'shape'");
  if (!std::regex_search(dictionary, std::regex("'fortran_order': *False")))
    fail_at(where, "is stored in Fortran order; save it with numpy.ascontiguousarray");

  Layout layout{descr[1], parse_shape(shape[1], where), prefix + length};
  const std::int64_t item = item_size(layout.type);
  if (item == 0) fail_at(where, "holds items of type '{}'; allowed are <f4 <f8 <i4 <i8 |u1", layout.type);
  const std::int64_t available = static_cast<std::int64_t>(size - layout.begin);
  std::int64_t expected = item;
  for (std::int64_t axis : layout.shape) {
    if (axis != 0 && expected > std::numeric_limits<std::int64_t>::max() / axis)
      fail_at(where, "states a shape larger than any file: {}", shape_text(layout.shape));
    expected *= axis;
  }
  if (expected != available)
    fail_at(where, "needs {} bytes of data (shape {}) but holds {}", expected, shape_text(layout.shape), available);
  return layout;
}

}  // namespace

NpyArray parse_npy(std::string_view content, const FileLocation& where) {
  Layout layout = parse_header(content, content.size(), where);
  NpyArray array{std::move(layout.type), std::move(layout.shape), {}};
  array.bytes.assign(content.begin() + static_cast<std::ptrdiff_t>(layout.begin), content.end());
  return array;
}

NpyArray read_npy(const std::filesystem::path& path) { return parse_npy(read_file(path), {path.string()}); }

std::string npy_bytes(const void* data, const std::string& type, const std::vector<std::int64_t>& shape) {
  std::int64_t size = item_size(type);
  if (size == 0) fail("npy_bytes: unknown item type '{}'", type);
  for (std::int64_t axis : shape) size *= axis;
  std::string bytes = header(type, shape);
  if (size > 0) bytes.append(static_cast<const char*>(data), as_size(size));
  return bytes;
}

void write_npy(const std::filesystem::path& path, const float* data, const std::vector<std::int64_t>& shape) {
  write_atomically(path, npy_bytes(data, "<f4", shape));
}

void write_npy(const std::filesystem::path& path, const double* data, const std::vector<std::int64_t>& shape) {
  write_atomically(path, npy_bytes(data, "<f8", shape));
}

NpyItems::NpyItems(const std::filesystem::path& path) : path_(path), file_(path, std::ios::binary) {
  if (!file_) fail_at({path.string()}, "cannot be opened: {}", std::strerror(errno));
  std::string head(kMaxDictionary + 12, '\0');
  file_.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(as_size(file_.gcount()));
  file_.clear();
  Layout layout = parse_header(head, std::filesystem::file_size(path), {path.string()});
  if ((layout.type != "<f4" && layout.type != "<f8") || layout.shape.empty())
    fail_at({path.string()}, "holds items of type '{}' and the shape {}; needed are <f4 or <f8 and at least one axis",
            layout.type, shape_text(layout.shape));
  type_ = layout.type;
  shape_ = std::move(layout.shape);
  begin_ = static_cast<std::streamoff>(layout.begin);
}

std::vector<float> NpyItems::read(std::int64_t item) {
  if (item < 0 || item >= size()) fail("{} has items 0 to {}, asked for {}", path_.string(), size() - 1, item);
  std::int64_t bytes_each = item_size(type_);
  for (std::size_t axis = 1; axis < shape_.size(); ++axis) bytes_each *= shape_[axis];
  std::vector<std::uint8_t> bytes(as_size(bytes_each));
  file_.seekg(begin_ + item * bytes_each);
  file_.read(reinterpret_cast<char*>(bytes.data()), bytes_each);
  if (!file_) fail("reading item {} of {}: the file ends, or the disk failed", item, path_.string());
  return type_ == "<f4" ? convert<float, float>(bytes) : convert<double, float>(bytes);
}

NpyStream::NpyStream(const std::filesystem::path& path, std::vector<std::int64_t> item_shape)
    : path_(path), temporary_(temporary_beside(path)), item_shape_(std::move(item_shape)) {
  for (std::int64_t axis : item_shape_) item_size_ *= axis;
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  file_ = std::fopen(temporary_.c_str(), "wb");
  if (!file_) fail("opening {} for writing: {}", temporary_.string(), std::strerror(errno));
  // Room for the header, which `close` writes. Nothing is written yet, so nothing can fail.
  std::fseek(file_, static_cast<long>(kStreamHeaderSize), SEEK_SET);
}

NpyStream::~NpyStream() {
  if (temporary_.empty()) return;  // it is complete
  if (file_) std::fclose(file_);
  std::error_code ignored;
  std::filesystem::remove(temporary_, ignored);
}

void NpyStream::append(std::span<const float> item) {
  if (item.size() != as_size(item_size_))
    fail("writing {}: an item has {} values, received {}", path_.string(), item_size_, item.size());
  write(file_, item.data(), item.size_bytes(), path_);
  ++items_;
}

void NpyStream::close() {
  std::vector<std::int64_t> shape{items_};
  shape.insert(shape.end(), item_shape_.begin(), item_shape_.end());
  const std::string head = header("<f4", shape, kStreamHeaderSize);
  if (std::fseek(file_, 0, SEEK_SET) != 0) fail("writing {}: {}", path_.string(), std::strerror(errno));
  write(file_, head.data(), head.size(), path_);
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail("writing {}: {}", path_.string(), std::strerror(errno));
  publish_file(temporary_, path_);
  temporary_.clear();
}

}  // namespace doppel
