#include "doppel/io/scene/fbx_file.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/scene/fbx_text.h"

namespace doppel {

namespace {

constexpr std::size_t kHeaderBytes = 27;
constexpr int kMaxDepth = 64;
constexpr long kMaxRecords = 20'000'000;
/// Deflate cannot shrink data by more than this factor; a larger announced size is a lie.
constexpr std::uint64_t kMaxRatio = 1040;

/// Reads the binary form. Every length is compared with what is left of its parent.
class FbxBinary {
 public:
  FbxBinary(const std::filesystem::path& path, const std::string& bytes, std::int64_t most_values)
      : where_{path.string(), 0}, bytes_(bytes), most_values_(as_size(most_values)) {
    const auto version = fixed<std::uint32_t>(23, bytes.size());
    if (version < 7000 || version > 8000)
      fail_at(where_, "is FBX version {}.{}; versions 7.0 to 7.7 are read. Export it again as FBX 7.4 (2014)",
              version / 1000, version % 1000 / 100);
    long_ = version >= 7500;
  }

  FbxRecord read() {
    FbxRecord root;
    std::size_t at = kHeaderBytes;
    while (at < bytes_.size()) {
      FbxRecord record;
      if (!read_record(at, bytes_.size(), 0, record)) return root;
      root.children.push_back(std::move(record));
    }
    fail_at(where_, "the file is truncated: its last record has no end");
  }

 private:
  template <typename T>
  T fixed(std::size_t at, std::size_t end) const {
    if (end > bytes_.size() || at > end || end - at < sizeof(T))
      fail_at(where_, "the file is truncated or damaged: a value at byte {} is cut off", at);
    T value;
    std::memcpy(&value, bytes_.data() + at, sizeof value);
    return value;
  }
  std::uint64_t length(std::size_t& at, std::size_t end) const {
    const std::uint64_t value = long_ ? fixed<std::uint64_t>(at, end) : fixed<std::uint32_t>(at, end);
    at += long_ ? 8 : 4;
    return value;
  }

  /// @return false for the empty record that ends a list
  bool read_record(std::size_t& at, std::size_t end, int depth, FbxRecord& record) {
    const std::size_t start = at;
    const std::uint64_t stop = length(at, end), values = length(at, end), value_bytes = length(at, end);
    const std::size_t name_length = fixed<std::uint8_t>(at++, end);
    if (stop == 0) return false;
    if (stop > end || stop <= start || at + name_length > stop || value_bytes > stop - at - name_length ||
        values > value_bytes)
      fail_at(where_, "the record at byte {} is longer than what is left: the file is truncated or damaged", start);
    if (++records_ > kMaxRecords || depth > kMaxDepth)
      fail_at(where_, "the file has more records than any figure needs; it is damaged");
    record.name = bytes_.substr(at, name_length);
    at += name_length;
    const std::size_t values_end = at + as_size(value_bytes);
    for (std::uint64_t i = 0; i < values; ++i) record.values.push_back(read_value(at, values_end));
    at = values_end;
    while (at < stop) {
      FbxRecord inner;
      if (!read_record(at, as_size(stop), depth + 1, inner)) break;
      record.children.push_back(std::move(inner));
    }
    at = as_size(stop);
    return true;
  }

  FbxValue read_value(std::size_t& at, std::size_t end) {
    const char type = fixed<char>(at++, end);
    switch (type) {
      case 'Y':
        return scalar<std::int16_t, std::int64_t>(at, end);
      case 'C':
      case 'B':
        return scalar<std::int8_t, std::int64_t>(at, end);
      case 'I':
        return scalar<std::int32_t, std::int64_t>(at, end);
      case 'L':
        return scalar<std::int64_t, std::int64_t>(at, end);
      case 'F':
        return scalar<float, double>(at, end);
      case 'D':
        return scalar<double, double>(at, end);
      case 'f':
        return array<float, double>(at, end);
      case 'd':
        return array<double, double>(at, end);
      case 'i':
        return array<std::int32_t, std::int64_t>(at, end);
      case 'l':
        return array<std::int64_t, std::int64_t>(at, end);
      case 'b':
      case 'c':
        return array<std::int8_t, std::int64_t>(at, end);
      case 'S':
      case 'R':
        return raw(at, end);
      default:
        fail_at(where_, "a value at byte {} has the type '{}', which FBX does not know: the file is damaged", at - 1,
                static_cast<int>(type));
    }
  }

  template <typename Stored, typename T>
  T scalar(std::size_t& at, std::size_t end) const {
    const T value = static_cast<T>(fixed<Stored>(at, end));
    at += sizeof(Stored);
    return value;
  }
  std::string raw(std::size_t& at, std::size_t end) const {
    const std::size_t size = fixed<std::uint32_t>(at, end);
    at += 4;
    if (size > end - at) fail_at(where_, "a text at byte {} is cut off: the file is truncated or damaged", at);
    at += size;
    return bytes_.substr(at - size, size);
  }

  template <typename Stored, typename T>
  std::vector<T> array(std::size_t& at, std::size_t end) {
    const std::uint64_t count = fixed<std::uint32_t>(at, end), size = count * sizeof(Stored);
    const auto packed = fixed<std::uint32_t>(at + 4, end);
    const std::uint64_t stored = fixed<std::uint32_t>(at + 8, end);
    at += 12;
    const std::uint64_t taken = packed ? stored : size;
    values_ += count;
    if (taken > end - at || (packed && size > stored * kMaxRatio + 64) || values_ > most_values_)
      fail_at(where_, "an array of {} values at byte {} is longer than its data: the file is truncated or damaged",
              count, at);
    std::vector<Stored> values(count);
    if (packed) {
      auto written = static_cast<uLongf>(size);
      const auto* data = reinterpret_cast<const Bytef*>(bytes_.data() + at);
      if (uncompress(reinterpret_cast<Bytef*>(values.data()), &written, data, static_cast<uLong>(stored)) != Z_OK ||
          written != size)
        fail_at(where_, "the compressed array at byte {} is damaged", at);
    } else if (size > 0) {
      std::memcpy(values.data(), bytes_.data() + at, as_size(size));
    }
    at += as_size(taken);
    return std::vector<T>(values.begin(), values.end());
  }

  FileLocation where_;
  const std::string& bytes_;
  std::size_t most_values_;
  bool long_ = false;
  long records_ = 0;
  std::uint64_t values_ = 0;  ///< of all arrays
};

}  // namespace

const FbxRecord* FbxRecord::child(const char* wanted) const {
  for (const FbxRecord& record : children)
    if (record.name == wanted) return &record;
  return nullptr;
}

double FbxRecord::number(std::size_t i, double fallback) const {
  if (i >= values.size()) return fallback;
  if (const auto* whole = std::get_if<std::int64_t>(&values[i])) return static_cast<double>(*whole);
  const auto* real = std::get_if<double>(&values[i]);
  return real ? *real : fallback;
}

std::int64_t FbxRecord::integer(std::size_t i, std::int64_t fallback) const {
  const auto* whole = i < values.size() ? std::get_if<std::int64_t>(&values[i]) : nullptr;
  return whole ? *whole : fallback;
}

std::string FbxRecord::text(std::size_t i) const {
  const auto* text = i < values.size() ? std::get_if<std::string>(&values[i]) : nullptr;
  return text ? *text : std::string();
}

std::vector<double> FbxRecord::numbers() const {
  if (values.empty()) return {};
  if (const auto* reals = std::get_if<std::vector<double>>(&values[0])) return *reals;
  if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&values[0])) return {whole->begin(), whole->end()};
  return {};
}

std::vector<std::int64_t> FbxRecord::integers() const {
  if (values.empty()) return {};
  if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&values[0])) return *whole;
  const auto* reals = std::get_if<std::vector<double>>(&values[0]);
  std::vector<std::int64_t> result;
  for (const double value : reals ? *reals : std::vector<double>())
    result.push_back(value > -9e18 && value < 9e18 ? static_cast<std::int64_t>(value) : -1);
  return result;
}

FbxRecord read_fbx_records(const std::filesystem::path& path, const SceneLimits& limits) {
  const std::string bytes = read_file(path);
  const std::int64_t most_values = 12 * limits.triangles;
  if (bytes.rfind("Kaydara FBX Binary", 0) == 0) return FbxBinary(path, bytes, most_values).read();
  return read_fbx_text(path, bytes);
}

FbxObjects::FbxObjects(const FbxRecord& root) {
  if (const FbxRecord* objects = root.child("Objects"))
    for (const FbxRecord& object : objects->children) {
      // Of objects with one id, only the first can be connected to anything.
      if (by_id_.emplace(object.integer(0), &object).second) objects_.push_back(&object);
    }
  if (const FbxRecord* connections = root.child("Connections"))
    for (const FbxRecord& connection : connections->children) {
      const std::int64_t lower = connection.integer(1), upper = connection.integer(2);
      const std::string property = connection.text(0) == "OP" ? connection.text(3) : std::string();
      below_[upper].push_back({lower, property});
      above_[lower].push_back({upper, property});
    }
}

std::vector<const FbxRecord*> FbxObjects::all(const char* kind) const {
  std::vector<const FbxRecord*> found;
  for (const FbxRecord* object : objects_)
    if (object->name == kind) found.push_back(object);
  return found;
}

const FbxRecord* FbxObjects::find(std::int64_t id) const {
  const auto found = by_id_.find(id);
  return found == by_id_.end() ? nullptr : found->second;
}

std::vector<const FbxRecord*> FbxObjects::below(const FbxRecord& object, const char* kind, const char* property) const {
  std::vector<const FbxRecord*> found;
  const auto connections = below_.find(object.integer(0));
  if (connections == below_.end()) return found;
  for (const Connection& connection : connections->second) {
    const FbxRecord* other = find(connection.other);
    if (other && (!kind || other->name == kind) && (!property || connection.property == property))
      found.push_back(other);
  }
  return found;
}

std::vector<std::pair<const FbxRecord*, std::string>> FbxObjects::above_with_property(const FbxRecord& object,
                                                                                      const char* kind) const {
  std::vector<std::pair<const FbxRecord*, std::string>> found;
  const auto connections = above_.find(object.integer(0));
  if (connections == above_.end()) return found;
  for (const Connection& connection : connections->second) {
    const FbxRecord* other = find(connection.other);
    if (other && other->name == kind) found.emplace_back(other, connection.property);
  }
  return found;
}

std::vector<const FbxRecord*> FbxObjects::above(const FbxRecord& object, const char* kind) const {
  std::vector<const FbxRecord*> found;
  for (const auto& [other, property] : above_with_property(object, kind)) found.push_back(other);
  return found;
}

std::string fbx_name(const FbxRecord& object) {
  const std::string text = object.text(1);
  if (const std::size_t mark = text.find(std::string("\0\1", 2)); mark != std::string::npos)
    return text.substr(0, mark);
  const std::size_t colons = text.find("::");
  return colons == std::string::npos ? text : text.substr(colons + 2);
}

const FbxRecord* fbx_property(const FbxRecord& object, const char* name) {
  const FbxRecord* properties = object.child("Properties70");
  if (!properties) return nullptr;
  for (const FbxRecord& property : properties->children)
    if (property.text(0) == name) return &property;
  return nullptr;
}

double fbx_number(const FbxRecord& object, const char* property, double fallback) {
  const FbxRecord* found = fbx_property(object, property);
  return found ? found->number(4, fallback) : fallback;
}

int fbx_choice(const FbxRecord& object, const char* property, int fallback, int largest) {
  const double value = fbx_number(object, property, fallback);
  return value >= 0 && value <= largest ? static_cast<int>(value) : fallback;
}

}  // namespace doppel
