#include "doppel/io/figure_export/glb_compression.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

namespace doppel {
namespace {

using Json = nlohmann::json;
using Bytes = std::vector<unsigned char>;

constexpr const char *kExtension = "EXT_meshopt_compression", *kIntegers = "KHR_mesh_quantization";
constexpr int kByte = 5120, kFloat = 5126, kTriangles = 4;
constexpr std::size_t kHeader = 12, kChunkHeader = 8, kMaxStride = 256;

bool begins_with(std::string_view text, std::string_view start) { return text.substr(0, start.size()) == start; }

std::uint32_t word_at(std::string_view bytes, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  return word;
}

void append_word(std::string& file, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  file.append(reinterpret_cast<const char*>(&word), sizeof word);
}

std::size_t element_size(const Json& accessor) {
  static const Json kWidths = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
  const int type = accessor["componentType"].get<int>();
  const std::size_t component = type == 5120 || type == 5121 ? 1 : type == 5122 || type == 5123 ? 2 : 4;
  return component * kWidths.at(accessor["type"].get<std::string>()).get<std::size_t>();
}

/// How the numbers of an accessor are written.
struct Coding {
  bool triangles = false, indices = false;
  bool bytes = false;          ///< floats become bytes
  std::optional<double> step;  ///< floats are rounded to multiples of it
};

/// The step of an attribute of a primitive; nothing for one that keeps its bits.
std::optional<double> attribute_step(std::string_view name, const GlbSteps& steps) {
  if (name == "POSITION") return steps.position;
  if (name == "NORMAL") return steps.normal;
  if (begins_with(name, "TEXCOORD_")) return steps.uv;
  if (begins_with(name, "COLOR_")) return steps.colour;
  if (begins_with(name, "WEIGHTS_")) return steps.skin_weight;
  if (name == "_VERTEX") return 1.0;
  if (name == "KHR_gaussian_splatting:SCALE") return steps.splat_scale;
  if (begins_with(name, "KHR_gaussian_splatting:")) return steps.splat;
  return std::nullopt;
}

std::optional<double> track_step(std::string_view path, const GlbSteps& steps) {
  if (path == "rotation") return steps.rotation;
  if (path == "translation") return steps.translation;
  if (path == "weights") return steps.morph_weight;
  return std::nullopt;
}

/// Floats as the filter EXPONENTIAL states them: the lower 24 bits are the multiple of the step, the upper 8 its power
/// of two. Nothing where a value has no such form.
std::optional<Bytes> exponential(std::span<const float> values, double step) {
  const auto exponent = static_cast<std::uint32_t>(std::ilogb(step)) << 24;
  Bytes words(4 * values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double multiple = std::nearbyint(static_cast<double>(values[i]) / step);
    if (!(std::abs(multiple) < 0x1p23)) return std::nullopt;
    const std::uint32_t word = exponent | (static_cast<std::uint32_t>(static_cast<std::int32_t>(multiple)) & 0xFFFFFF);
    std::memcpy(&words[4 * i], &word, sizeof word);
  }
  return words;
}

/// Three floats of -1 to 1 as four bytes, the last of which is 0.
Bytes byte_rows(std::span<const float> values) {
  Bytes rows(values.size() / 3 * 4);
  for (std::size_t i = 0; i < values.size(); ++i)
    rows[i / 3 * 4 + i % 3] = static_cast<unsigned char>(
        static_cast<std::int8_t>(std::lround(127 * std::clamp(static_cast<double>(values[i]), -1.0, 1.0))));
  return rows;
}

Bytes encode_vertices(const void* data, std::size_t count, std::size_t stride) {
  Bytes stream(meshopt_encodeVertexBufferBound(count, stride));
  stream.resize(meshopt_encodeVertexBuffer(stream.data(), stream.size(), data, count, stride));
  return stream;
}

Bytes encode_triangles(std::span<const std::uint32_t> corners) {
  std::uint32_t vertices = 0;
  for (const std::uint32_t corner : corners) vertices = std::max(vertices, corner + 1);
  Bytes stream(meshopt_encodeIndexBufferBound(corners.size(), vertices));
  stream.resize(meshopt_encodeIndexBuffer(stream.data(), stream.size(), corners.data(), corners.size()));
  return stream;
}

class GlbCompressor {
 public:
  GlbCompressor(std::string_view glb, const GlbSteps& steps) : steps_(steps) {
    const std::size_t length = word_at(glb, kHeader);
    json_ = Json::parse(glb.substr(kHeader + kChunkHeader, length));
    const std::size_t binary = kHeader + kChunkHeader + length + kChunkHeader;
    if (binary < glb.size()) binary_ = glb.substr(binary);
  }

  std::string compressed() {
    find_codings();
    std::vector<int> accessor_of(json_["bufferViews"].size(), -1);
    for (std::size_t a = 0; a < json_["accessors"].size(); ++a)
      accessor_of.at(json_["accessors"][a]["bufferView"].get<std::size_t>()) = static_cast<int>(a);
    for (std::size_t v = 0; v < accessor_of.size(); ++v)
      if (accessor_of[v] < 0 || !compress(json_["bufferViews"][v], static_cast<std::size_t>(accessor_of[v])))
        append(json_["bufferViews"][v], binary_of(json_["bufferViews"][v]));
    json_["buffers"] = {{{"byteLength", packed_.size()}}};
    if (unpacked_bytes_ > 0) {
      json_["buffers"].push_back(
          {{"byteLength", unpacked_bytes_}, {"extensions", {{kExtension, {{"fallback", true}}}}}});
      require(kExtension);
      if (has_bytes_) require(kIntegers);
    }
    return file();
  }

 private:
  void find_codings() {
    codings_.resize(json_["accessors"].size());
    for (const Json& mesh : json_.value("meshes", Json::array()))
      for (const Json& primitive : mesh["primitives"]) {
        const bool triangles = primitive.value("mode", kTriangles) == kTriangles;
        if (primitive.contains("indices"))
          (triangles ? coding(primitive["indices"]).triangles : coding(primitive["indices"]).indices) = true;
        for (const auto& [name, accessor] : primitive["attributes"].items())
          coding(accessor).step = attribute_step(name, steps_);
        for (const Json& target : primitive.value("targets", Json::array())) find_coding_of(target);
      }
    for (const Json& animation : json_.value("animations", Json::array()))
      for (const Json& channel : animation["channels"])
        coding(animation["samplers"][channel["sampler"].get<std::size_t>()]["output"]).step =
            track_step(channel["target"]["path"].get<std::string>(), steps_);
  }

  void find_coding_of(const Json& target) {
    if (target.contains("POSITION")) coding(target["POSITION"]).step = steps_.displacement;
    if (target.contains("NORMAL")) coding(target["NORMAL"]).bytes = true;
  }

  Coding& coding(const Json& accessor) { return codings_.at(accessor.get<std::size_t>()); }

  std::string_view binary_of(const Json& view) const {
    return binary_.substr(view.value("byteOffset", std::size_t{0}), view["byteLength"].get<std::size_t>());
  }

  /// @return false for a view that the extension has no form for
  bool compress(Json& view, std::size_t index) {
    Json& accessor = json_["accessors"][index];
    const std::string_view data = binary_of(view);
    const std::size_t count = accessor["count"].get<std::size_t>(), stride = element_size(accessor);
    if (count == 0 || stride % 4 != 0 || stride > kMaxStride || codings_[index].indices) return false;
    Json extension = {{"buffer", 0}, {"byteStride", stride}, {"count", count}, {"mode", "ATTRIBUTES"}};
    const Bytes stream = encode(data, codings_[index], accessor, view, extension);
    append(extension, {reinterpret_cast<const char*>(stream.data()), stream.size()});
    view["buffer"] = 1;
    view["byteOffset"] = unpacked_bytes_;
    view["byteLength"] = count * extension["byteStride"].get<std::size_t>();
    view["extensions"][kExtension] = extension;
    unpacked_bytes_ += (view["byteLength"].get<std::size_t>() + 3) / 4 * 4;
    return true;
  }

  /// Encodes a view, and says how in `extension`; accessor and view change where their numbers become bytes.
  Bytes encode(std::string_view data, const Coding& coding, Json& accessor, Json& view, Json& extension) {
    const std::size_t count = accessor["count"].get<std::size_t>(), stride = element_size(accessor);
    if (coding.triangles) {
      extension["mode"] = "TRIANGLES";
      return encode_triangles({reinterpret_cast<const std::uint32_t*>(data.data()), count});
    }
    if (coding.bytes && accessor["componentType"] == kFloat) {
      const Bytes rows = byte_rows({reinterpret_cast<const float*>(data.data()), 3 * count});
      accessor["componentType"] = kByte;
      accessor["normalized"] = true;
      view["byteStride"] = extension["byteStride"] = 4;
      has_bytes_ = true;
      return encode_vertices(rows.data(), count, 4);
    }
    const auto words = coding.step ? rounded(data, accessor, *coding.step) : std::nullopt;
    if (!words) return encode_vertices(data.data(), count, stride);
    extension["filter"] = "EXPONENTIAL";
    return encode_vertices(words->data(), count, stride);
  }

  static std::optional<Bytes> rounded(std::string_view data, Json& accessor, double step) {
    if (accessor["componentType"] != kFloat) return std::nullopt;
    auto words = exponential({reinterpret_cast<const float*>(data.data()), data.size() / 4}, step);
    for (const char* bound : {"min", "max"})
      if (words && accessor.contains(bound))
        for (Json& value : accessor[bound]) value = round_to_step(value.get<double>(), step);
    return words;
  }

  void require(const char* extension) {
    json_["extensionsUsed"].push_back(extension);
    json_["extensionsRequired"].push_back(extension);
  }

  /// Appends bytes to the new buffer, and says in `range` where they are.
  void append(Json& range, std::string_view bytes) {
    packed_.resize((packed_.size() + 3) / 4 * 4);
    range["byteOffset"] = packed_.size();
    range["byteLength"] = bytes.size();
    packed_.append(bytes);
  }

  std::string file() {
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    packed_.resize((packed_.size() + 3) / 4 * 4);
    std::string glb;
    append_word(glb, 0x46546C67);
    append_word(glb, 2);
    append_word(glb, kHeader + 2 * kChunkHeader + text.size() + packed_.size());
    append_word(glb, text.size());
    append_word(glb, 0x4E4F534A);
    glb += text;
    append_word(glb, packed_.size());
    append_word(glb, 0x004E4942);
    return glb + packed_;
  }

  GlbSteps steps_;
  Json json_;
  std::string_view binary_;
  std::vector<Coding> codings_;  ///< of each accessor
  std::string packed_;
  std::size_t unpacked_bytes_ = 0;
  bool has_bytes_ = false;
};

}  // namespace

double round_to_step(double value, double step) { return step * std::nearbyint(value / step); }

std::string compressed_glb(std::string_view glb, const GlbSteps& steps) {
  return GlbCompressor(glb, steps).compressed();
}

}  // namespace doppel
