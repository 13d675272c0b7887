#include "doppel/io/scene/gltf_file.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/io/scene/gltf_component.h"
#include "doppel/io/scene/meshopt_view.h"
#include "doppel/io/scene/scene_images.h"

namespace doppel {

namespace {

using Json = nlohmann::json;

constexpr int kMaxJsonDepth = 64;
/// Bytes of all buffers together, and how often all values of the largest mesh may be read: several accessors may read
/// the same bytes, so a small file could ask for any amount of work.
constexpr std::size_t kMaxBufferBytes = std::size_t{1} << 32;
constexpr double kMaxReadings = 64;

constexpr std::uint32_t kGlbMark = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

std::uint32_t little_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
  return value;
}

int base64_digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return -1;
}

/// Stops at the first character that is no digit, as the padding is.
std::string decode_base64(std::string_view text) {
  std::string bytes;
  unsigned bits = 0;
  int held = 0;
  for (const char c : text) {
    const int digit = base64_digit(c);
    if (digit < 0) break;
    bits = (bits << 6) | static_cast<unsigned>(digit);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes += static_cast<char>((bits >> held) & 0xFF);
  }
  return bytes;
}

/// Names of one extension, the newest last. They differ in the versions of the codec that a stream may have.
constexpr const char* kMeshoptExtensions[] = {"MESHOPT_compression", "EXT_meshopt_compression",
                                              "KHR_meshopt_compression"};
constexpr std::string_view kReadExtensions[] = {"KHR_mesh_quantization",   "KHR_texture_transform",
                                                "EXT_texture_webp",        "KHR_materials_pbrSpecularGlossiness",
                                                "MESHOPT_compression",     "EXT_meshopt_compression",
                                                "KHR_meshopt_compression", "KHR_draco_mesh_compression"};
/// Parts of the names of extensions that change the look of a surface or say something about the file. Without them
/// the vertices are where they should be.
constexpr std::string_view kLookExtensions[] = {"_materials_", "_texture_", "_lights_", "_image",
                                                "_xmp",        "VRM",       "ngon",     "_variants"};

}  // namespace

const Json& GltfFile::meshopt_of(const Json& element) const {
  const Json& extensions = object(element, "extensions");
  const auto* found = std::find_if(std::begin(kMeshoptExtensions), std::end(kMeshoptExtensions),
                                   [&](const char* name) { return extensions.contains(name); });
  return object(extensions, found == std::end(kMeshoptExtensions) ? kMeshoptExtensions[0] : *found);
}

/// A file says which extensions a program must understand to read it rightly.
void GltfFile::check_extensions() {
  std::vector<std::string> unread;
  bool only_look = true;
  for (const Json& entry : list("extensionsRequired")) {
    if (!entry.is_string()) fail_here("extensionsRequired holds {}, which is not a name", excerpt(entry.dump(), 40));
    const auto name = entry.get<std::string>();
    if (std::find(std::begin(kReadExtensions), std::end(kReadExtensions), name) != std::end(kReadExtensions)) continue;
    unread.push_back(excerpt(name, 80));
    only_look &= std::any_of(std::begin(kLookExtensions), std::end(kLookExtensions),
                             [&](std::string_view part) { return name.find(part) != std::string::npos; });
  }
  if (unread.empty()) return;
  const std::string names = excerpt(fmt::format("{}", fmt::join(unread, ", ")), 400);
  if (!only_look) fail_here("the file requires extensions that are not read: {}; export it without them", names);
  look_warning_ = fmt::format(
      "the file requires extensions that are not read: {}; they change the look of a surface, not its shape", names);
}

GltfFile::GltfFile(const std::filesystem::path& path, const SceneLimits& limits) : path_(path), limits_(limits) {
  read_container(read_file(path));
  if (!root_.is_object()) fail_here("the JSON of the glTF file is not an object");
  const std::string version = text(object(root_, "asset"), "version");
  if (version.empty() || version[0] != '2')
    fail_here("is glTF version '{}'; only version 2.0 is read. Export it again as glTF 2.0", version);
  check_extensions();
  read_buffers();
}

/// The depth is bounded, because copying and printing nested values is recursive. (The library's own callback for the
/// depth needs time with the square of the longest list.)
void GltfFile::parse_json(std::string_view text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') quoted = !quoted;
    if (quoted && c == '\\') ++i;
    if (quoted) continue;
    depth += (c == '{' || c == '[') - (c == '}' || c == ']');
    if (depth > kMaxJsonDepth) fail_here("the JSON of the glTF file is nested more than {} deep", kMaxJsonDepth);
  }
  root_ = Json::parse(text, nullptr, false);
  if (root_.is_discarded()) fail_here("the JSON of the glTF file cannot be read: the file is truncated or damaged");
}

void GltfFile::read_container(const std::string& file) {
  std::string_view json = file;
  if (file.size() >= 12 && little_endian(file, 0) == kGlbMark) {
    const std::size_t length = little_endian(file, 8);
    if (length > file.size())
      fail_here("the file is truncated: its header announces {} bytes, it has {}", length, file.size());
    json = {};
    for (std::size_t at = 12; at + 8 <= length;) {
      const std::size_t size = little_endian(file, at), type = little_endian(file, at + 4);
      if (size > length - at - 8)
        fail_here("the chunk at byte {} announces {} bytes, but {} are left: the file is truncated or damaged", at,
                  size, length - at - 8);
      if (type == kJsonChunk && json.empty()) json = std::string_view(file).substr(at + 8, size);
      if (type == kBinaryChunk && !has_binary_) {
        binary_ = file.substr(at + 8, size);
        has_binary_ = true;
      }
      at += 8 + size;
    }
    if (json.empty()) fail_here("the file has no JSON chunk: it is truncated or no glTF file");
  }
  parse_json(json);
}

void GltfFile::read_buffers() {
  const Json& buffers = list("buffers");
  std::size_t total = 0;
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    const std::string where = fmt::format("buffers[{}]", i), uri = text(buffers[i], "uri");
    const double length = number(buffers[i], "byteLength", 0, where);
    // Of compressed views, a buffer may stand for what they become; without data it is missed only where it is used.
    if (uri.empty() && !meshopt_of(buffers[i]).empty()) {
      buffers_.emplace_back();
      continue;
    }
    std::string bytes = uri.empty() && i == 0 && has_binary_ ? std::move(binary_) : buffer_of_uri(uri, where);
    if (!(length >= 0) || length > static_cast<double>(bytes.size()))
      fail_here("{} announces {} bytes, but {} are there: the file is truncated", where, length, bytes.size());
    total += bytes.size();
    if (total > kMaxBufferBytes) fail_here("the buffers hold more than {} bytes together", kMaxBufferBytes);
    buffers_.push_back(std::move(bytes));
  }
}

std::string GltfFile::buffer_of_uri(const std::string& uri, const std::string& where) const {
  if (uri.empty()) fail_here("{} has no data: neither a uri nor a binary chunk", where);
  if (uri.rfind("data:", 0) == 0) {
    const std::size_t comma = uri.find(',');
    return comma == std::string::npos ? std::string() : decode_base64(std::string_view(uri).substr(comma + 1));
  }
  const std::filesystem::path found = find_image(path_, uri);
  if (found.empty()) fail_here("{} names the file '{}', which does not lie beside the glTF file", where, uri);
  return read_file(found);
}

const Json& GltfFile::list(const char* name) const { return array(root_, name, name); }

const Json& GltfFile::array(const Json& object, const char* name, const std::string& where) const {
  static const Json kNone = Json::array();
  const auto found = object.find(name);
  if (found == object.end()) return kNone;
  if (!found->is_array()) fail_here("{}: '{}' is not a list", where, name);
  return *found;
}

const Json& GltfFile::object(const Json& parent, const char* name) const {
  static const Json kNone = Json::object();
  if (!parent.is_object()) return kNone;
  const auto found = parent.find(name);
  return found != parent.end() && found->is_object() ? *found : kNone;
}

double GltfFile::number(const Json& object, const char* name, double fallback, const std::string& where) const {
  if (!object.is_object()) fail_here("{} is not an object", where);
  const auto found = object.find(name);
  if (found == object.end()) return fallback;
  if (!found->is_number()) fail_here("{}.{} is not a number", where, name);
  return found->get<double>();
}

std::string GltfFile::text(const Json& object, const char* name) const {
  if (!object.is_object()) return {};
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

int GltfFile::whole(const Json& object, const char* name, int fallback, const std::string& where) const {
  const double value = number(object, name, fallback, where);
  if (!(std::abs(value) < 1e9) || value != std::floor(value)) fail_here("{}.{} is {}", where, name, value);
  return static_cast<int>(value);
}

int GltfFile::index(const Json& object, const char* name, std::size_t count, const std::string& where,
                    bool needed) const {
  const double value = number(object, name, -1, where);
  if (value == -1 && !needed) return -1;
  if (!(value >= 0) || value != std::floor(value) || value >= static_cast<double>(count))
    fail_here("{}.{} is {}, but the file has {} of them", where, name, value, count);
  return static_cast<int>(value);
}

std::vector<double> GltfFile::vector(const Json& object, const char* name, std::size_t count,
                                     const std::string& where) const {
  if (!object.is_object()) fail_here("{} is not an object", where);
  const Json& list = array(object, name, where);
  if (list.empty()) return {};
  if (list.size() != count) fail_here("{}.{} has {} numbers, expected {}", where, name, list.size(), count);
  std::vector<double> values;
  for (const Json& value : list) {
    if (!value.is_number()) fail_here("{}.{} holds something that is not a number", where, name);
    values.push_back(value.get<double>());
  }
  return values;
}

GltfFile::View GltfFile::view(int index, const std::string& where) const {
  const Json& views = list("bufferViews");
  const Json& view = views[index];
  const std::string element = fmt::format("bufferViews[{}]", index);
  const std::string& buffer = buffers_[this->index(view, "buffer", buffers_.size(), element, true)];
  const double stride = number(view, "byteStride", 0, element);
  if (!(stride >= 0) || stride > 65536) fail_here("{}.byteStride is {}", element, stride);
  // Where the file has the bytes also without compression, they are taken.
  if (const Json& packing = meshopt_of(view); buffer.empty() && !packing.empty())
    return {unpacked_view(index, packing, element), as_size(stride)};
  return {bytes_of_range(view, fmt::format("{} (of {})", element, where), element), as_size(stride)};
}

/// The bytes of a buffer that an object with `buffer`, `byteOffset` and `byteLength` names.
std::string_view GltfFile::bytes_of_range(const Json& range, const std::string& who, const std::string& where) const {
  const std::string& buffer = buffers_[index(range, "buffer", buffers_.size(), where, true)];
  const double offset = number(range, "byteOffset", 0, where), length = number(range, "byteLength", -1, where);
  if (!(offset >= 0) || !(length >= 0) || offset + length > static_cast<double>(buffer.size()))
    fail_here("{} covers the bytes {} to {}, but its buffer has {}", who, offset, offset + length, buffer.size());
  return std::string_view(buffer).substr(as_size(offset), as_size(length));
}

std::string_view GltfFile::unpacked_view(int index, const Json& packing, const std::string& element) const {
  if (const auto known = unpacked_.find(index); known != unpacked_.end()) return known->second;
  const std::string where = element + ".meshopt_compression";
  MeshoptView view;
  view.stream = bytes_of_range(packing, where, where);
  view.count = as_size(std::max(whole(packing, "count", 0, where), 0));
  view.stride = as_size(std::max(whole(packing, "byteStride", 0, where), 0));
  view.mode = text(packing, "mode");
  view.filter = text(packing, "filter");
  view.max_bytes = kMaxBufferBytes - unpacked_bytes_;
  UnpackedView result = unpack_meshopt(view);
  if (!result.fault.empty()) fail_here("{} {}", element, result.fault);
  unpacked_bytes_ += result.bytes.size();
  return unpacked_[index] = std::move(result.bytes);
}

std::string_view GltfFile::bytes_of_view(int index, const std::string& where) const { return view(index, where).bytes; }

void GltfFile::count_values(double values) const {
  values_read_ += values;
  if (values_read_ > kMaxReadings * static_cast<double>(limits_.triangles + limits_.vertices))
    fail_here("the meshes and animations use the accessors more often than any figure does: the file is damaged");
}

GltfNumbers GltfFile::numbers(std::size_t accessor, std::size_t width, const char* what) const {
  const Json& accessors = list("accessors");
  if (accessor >= accessors.size())
    fail_here("{} name accessor {}, but the file has {}", what, accessor, accessors.size());
  const Json& entry = accessors[accessor];
  const std::string where = fmt::format("accessors[{}]", accessor);
  GltfNumbers result;
  result.width = width_of_type(text(entry, "type"));
  const int type = whole(entry, "componentType", 0, where);
  const std::size_t size = component_size(type) * result.width;
  if (size == 0) fail_here("{} has the type '{}' of components {}", where, text(entry, "type").substr(0, 40), type);
  if (width != 0 && result.width != width)
    fail_here("{} ({}) has {} values per row, expected {}", where, what, result.width, width);
  const int index_of_view = index(entry, "bufferView", list("bufferViews").size(), where);
  result.count = count_of(entry, result.width, index_of_view >= 0, where);
  const bool normalized = entry.contains("normalized") && entry["normalized"] == true;
  if (index_of_view < 0 && object(entry, "sparse").empty())
    fail_here("{} ({}) has no data: neither a buffer view nor sparse values", where, what);
  if (index_of_view >= 0) {
    const View data = view(index_of_view, where);
    const std::size_t stride = data.stride > 0 ? data.stride : size;
    const double offset = number(entry, "byteOffset", 0, where);
    const double count = static_cast<double>(result.count);
    const double needed =
        offset + (count > 0 ? (count - 1) * static_cast<double>(stride) + static_cast<double>(size) : 0);
    if (!(offset >= 0) || needed > static_cast<double>(data.bytes.size()))
      fail_here("{} ({}) needs {} bytes, but its view has {}: the file is truncated or damaged", where, what, needed,
                data.bytes.size());
    result.values.reserve(result.count * result.width);
    for (std::size_t i = 0; i < result.count; ++i)
      for (std::size_t c = 0; c < result.width; ++c)
        result.values.push_back(component_value(
            data.bytes.data() + as_size(offset) + i * stride + c * component_size(type), type, normalized));
  } else {
    result.values.assign(result.count * result.width, 0.0);
  }
  fill_sparse(entry, where, result, type, normalized);
  return result;
}

/// @param stored whether a buffer view has the rows; without one they are 0, and nothing in the file bounds their
/// number
std::size_t GltfFile::count_of(const Json& accessor, std::size_t width, bool stored, const std::string& where) const {
  const double count = number(accessor, "count", 0, where);
  const std::int64_t most = stored ? 3 * limits_.triangles : limits_.vertices;
  if (!(count >= 0) || count > static_cast<double>(most) || (!stored && width > 4))
    fail_here("{}.count is {}; at most {} are read", where, count, most);
  count_values(std::floor(count) * static_cast<double>(width));
  return as_size(count);
}

void GltfFile::fill_sparse(const Json& accessor, const std::string& where, GltfNumbers& numbers, int type,
                           bool normalized) const {
  const Json& sparse = object(accessor, "sparse");
  if (sparse.empty()) return;
  const Json &indices = object(sparse, "indices"), &values = object(sparse, "values");
  const double count = number(sparse, "count", 0, where + ".sparse");
  const std::size_t views = list("bufferViews").size();
  const View index_view = view(index(indices, "bufferView", views, where + ".sparse.indices", true), where);
  const View value_view = view(index(values, "bufferView", views, where + ".sparse.values", true), where);
  const int index_type = whole(indices, "componentType", 0, where + ".sparse.indices");
  const std::size_t index_size = component_size(index_type), size = component_size(type) * numbers.width;
  const double index_start = number(indices, "byteOffset", 0, where), start = number(values, "byteOffset", 0, where);
  if (index_size == 0 || !(count >= 0) || !(index_start >= 0) || !(start >= 0) ||
      index_start + count * static_cast<double>(index_size) > static_cast<double>(index_view.bytes.size()) ||
      start + count * static_cast<double>(size) > static_cast<double>(value_view.bytes.size()))
    fail_here("{}.sparse covers more bytes than its views have", where);
  for (std::size_t i = 0; i < as_size(count); ++i) {
    const double row =
        component_value(index_view.bytes.data() + as_size(index_start) + i * index_size, index_type, false);
    if (!(row >= 0) || row >= static_cast<double>(numbers.count))
      fail_here("{}.sparse names row {}, but there are {}", where, row, numbers.count);
    for (std::size_t c = 0; c < numbers.width; ++c)
      numbers.values[as_size(row) * numbers.width + c] = component_value(
          value_view.bytes.data() + as_size(start) + i * size + c * component_size(type), type, normalized);
  }
}

std::string GltfFile::image_bytes(std::size_t image) const {
  const Json& entry = list("images")[image];
  const std::string where = fmt::format("images[{}]", image), uri = text(entry, "uri");
  if (uri.rfind("data:", 0) == 0) return buffer_of_uri(uri, where);
  if (!uri.empty()) {
    const std::filesystem::path found = find_image(path_, uri);
    return found.empty() ? std::string() : read_file(found);
  }
  const int index_of_view = index(entry, "bufferView", list("bufferViews").size(), where);
  return index_of_view < 0 ? std::string() : std::string(view(index_of_view, where).bytes);
}

}  // namespace doppel
