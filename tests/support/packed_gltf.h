#pragma once

#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "support/gltf_writer.h"

namespace doppel::support {

/// A sleeve along y, bent as `bending_arm` is: a grid of 9 rows of 7 vertices, whose upper half follows the second
/// joint. With UVs, colours and a morph target that widens it, which is at 0.5 by default.
inline GltfWriter bending_sleeve() {
  constexpr int kRows = 9, kColumns = 7;
  GltfWriter file = bending_arm();
  std::vector<float> positions, weights, uvs, colours, moves;
  std::vector<std::uint8_t> joints;
  std::vector<std::uint16_t> corners;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const float u = static_cast<float>(column) / (kColumns - 1), v = static_cast<float>(row) / (kRows - 1);
      const float x = 0.2F * std::sin(3 * u), z = 0.2F * std::cos(3 * u), share = std::clamp(3 * v - 1, 0.0F, 1.0F);
      positions.insert(positions.end(), {x, 2 * v, z});
      moves.insert(moves.end(), {0.5F * x, 0.01F * v, 0.5F * z});
      uvs.insert(uvs.end(), {u, v});
      colours.insert(colours.end(), {u, v, 0.5F});
      weights.insert(weights.end(), {1 - share, share, 0, 0});
      joints.insert(joints.end(), {0, 1, 0, 0});
      if (row + 1 == kRows || column + 1 == kColumns) continue;
      const auto a = static_cast<std::uint16_t>(row * kColumns + column), b = static_cast<std::uint16_t>(a + kColumns);
      for (const int corner : {int{a}, a + 1, int{b}, a + 1, b + 1, int{b}})
        corners.push_back(static_cast<std::uint16_t>(corner));
    }
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  primitive["attributes"] = {{"POSITION", file.floats(positions, "VEC3", 3)},
                             {"TEXCOORD_0", file.floats(uvs, "VEC2", 2)},
                             {"COLOR_0", file.floats(colours, "VEC3", 3)},
                             {"JOINTS_0", file.bytes(joints, "VEC4", 4)},
                             {"WEIGHTS_0", file.floats(weights, "VEC4", 4)}};
  primitive["indices"] = file.shorts(corners);
  primitive["targets"] = {{{"POSITION", file.floats(moves, "VEC3", 3)}}};
  file.json["meshes"][0]["weights"] = {0.5};
  return file;
}

/// The two parts of a .glb with one buffer.
struct GlbParts {
  using Json = GltfWriter::Json;
  Json json;
  std::string binary;

  explicit GlbParts(const GltfWriter& file) {
    const std::string glb = file.glb();
    std::uint32_t size = 0;
    std::memcpy(&size, glb.data() + 12, 4);
    json = Json::parse(glb.substr(20, size));
    binary = glb.substr(28 + size);
  }

  std::string bytes_of(const Json& accessor) const {
    const Json& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    return binary.substr(view["byteOffset"].get<std::size_t>(), view["byteLength"].get<std::size_t>());
  }
  std::vector<float> floats_of(const Json& accessor) const {
    const std::string bytes = bytes_of(accessor);
    std::vector<float> values(bytes.size() / 4);
    std::memcpy(values.data(), bytes.data(), 4 * values.size());
    return values;
  }
  std::size_t append(const std::string& bytes) {
    binary.resize((binary.size() + 3) / 4 * 4);
    binary += bytes;
    return binary.size() - bytes.size();
  }
  std::string glb() const {
    GltfWriter writer;
    writer.view({binary.begin(), binary.end()});
    writer.json = json;
    writer.json["buffers"][0]["byteLength"] = binary.size();
    return writer.glb();
  }
};

// ---- meshoptimizer ----

using PackedBytes = std::vector<unsigned char>;

inline PackedBytes packed_attributes(const void* data, std::size_t count, std::size_t stride) {
  PackedBytes stream(meshopt_encodeVertexBufferBound(count, stride));
  stream.resize(meshopt_encodeVertexBuffer(stream.data(), stream.size(), data, count, stride));
  return stream;
}

inline PackedBytes packed_triangles(const std::vector<std::uint32_t>& corners, std::size_t vertices) {
  PackedBytes stream(meshopt_encodeIndexBufferBound(corners.size(), vertices));
  stream.resize(meshopt_encodeIndexBuffer(stream.data(), stream.size(), corners.data(), corners.size()));
  return stream;
}

inline PackedBytes packed_sequence(const std::vector<std::uint32_t>& indices, std::size_t vertices) {
  PackedBytes stream(meshopt_encodeIndexSequenceBound(indices.size(), vertices));
  stream.resize(meshopt_encodeIndexSequence(stream.data(), stream.size(), indices.data(), indices.size()));
  return stream;
}

struct MeshoptPacking {
  const char* index_mode = "TRIANGLES";  ///< or INDICES
  int float_bits = 0;                    ///< of the filter EXPONENTIAL; 0: floats keep their bits
  int rotation_bits = 0;                 ///< of the filter QUATERNION; 0: none
  const char* extension = "EXT_meshopt_compression";
  /// Changes the JSON before it is written. Buffer 0 holds the compressed bytes, buffer 1 holds nothing.
  std::function<void(GltfWriter::Json& json)> change = [](GltfWriter::Json&) {};
};

namespace packed_gltf {

inline std::size_t width_of(const GltfWriter::Json& accessor) {
  static const std::map<std::string, std::size_t> kWidths{
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
  return kWidths.at(accessor["type"].get<std::string>());
}

/// The compressed bytes of an accessor; `extension` gets mode, filter and stride.
inline PackedBytes packed(const GlbParts& plain, GltfWriter::Json& accessor, bool rotations,
                          const MeshoptPacking& packing, GltfWriter::Json& extension) {
  const std::string bytes = plain.bytes_of(accessor);
  const std::size_t count = accessor["count"].get<std::size_t>(), stride = bytes.size() / count;
  extension = {{"count", count}, {"byteStride", stride}, {"mode", "ATTRIBUTES"}};
  if (accessor["componentType"] == 5123 && accessor["type"] == "SCALAR") {
    std::vector<std::uint16_t> shorts(count);
    std::memcpy(shorts.data(), bytes.data(), bytes.size());
    const std::vector<std::uint32_t> corners(shorts.begin(), shorts.end());
    extension["mode"] = packing.index_mode;
    const bool triangles = std::string(packing.index_mode) == "TRIANGLES";
    return triangles ? packed_triangles(corners, count) : packed_sequence(corners, count);
  }
  const std::size_t padded = (stride + 3) / 4 * 4;
  extension["byteStride"] = padded;
  std::string data(padded * count, '\0');
  for (std::size_t i = 0; i < count; ++i) std::memcpy(&data[padded * i], &bytes[stride * i], stride);
  if (rotations && packing.rotation_bits > 0) {
    data.assign(8 * count, '\0');
    meshopt_encodeFilterQuat(data.data(), count, 8, packing.rotation_bits, plain.floats_of(accessor).data());
    accessor["componentType"] = 5122;
    accessor["normalized"] = true;
    extension["byteStride"] = 8;
    extension["filter"] = "QUATERNION";
  } else if (accessor["componentType"] == 5126 && packing.float_bits > 0) {
    meshopt_encodeFilterExp(data.data(), count, stride, packing.float_bits, plain.floats_of(accessor).data());
    extension["filter"] = "EXPONENTIAL";
  }
  return packed_attributes(data.data(), count, extension["byteStride"].get<std::size_t>());
}

}  // namespace packed_gltf

/// The file with all accessors compressed by meshoptimizer's own encoders.
inline std::string meshopt_glb(const GltfWriter& file, const MeshoptPacking& packing = {}) {
  GlbParts plain(file), result = plain;
  result.binary.clear();
  std::vector<std::size_t> rotations;
  for (const auto& animation : plain.json["animations"])
    for (const auto& sampler : animation["samplers"]) rotations.push_back(sampler["output"].get<std::size_t>());
  std::size_t unpacked = 0;
  for (std::size_t a = 0; a < plain.json["accessors"].size(); ++a) {
    auto& accessor = result.json["accessors"][a];
    GltfWriter::Json extension;
    const bool rotation = std::find(rotations.begin(), rotations.end(), a) != rotations.end();
    const PackedBytes stream = packed_gltf::packed(plain, accessor, rotation, packing, extension);
    extension["buffer"] = 0;
    extension["byteOffset"] = result.append(std::string(stream.begin(), stream.end()));
    extension["byteLength"] = stream.size();
    const std::size_t size = extension["count"].get<std::size_t>() * extension["byteStride"].get<std::size_t>();
    result.json["bufferViews"][accessor["bufferView"].get<std::size_t>()] = {
        {"buffer", 1},
        {"byteOffset", unpacked},
        {"byteLength", size},
        {"extensions", {{packing.extension, extension}}}};
    if (extension["mode"] == "ATTRIBUTES" && accessor["componentType"] != 5126)
      result.json["bufferViews"][accessor["bufferView"].get<std::size_t>()]["byteStride"] = extension["byteStride"];
    unpacked += (size + 3) / 4 * 4;
  }
  result.json["buffers"] = {{{"byteLength", result.binary.size()}},
                            {{"byteLength", unpacked}, {"extensions", {{packing.extension, {{"fallback", true}}}}}}};
  result.json["extensionsUsed"] = result.json["extensionsRequired"] = {packing.extension};
  packing.change(result.json);
  return result.glb();
}

// ---- Draco ----

struct DracoPacking {
  int method = draco::MESH_EDGEBREAKER_ENCODING;
  int position_bits = 0;  ///< 0: floats keep their bits
  /// Changes the stream before it is written.
  std::function<void(std::string& stream)> change = [](std::string&) {};
};

namespace packed_gltf {

inline draco::DataType draco_type(int component) {
  return component == 5126 ? draco::DT_FLOAT32 : component == 5121 ? draco::DT_UINT8 : draco::DT_UINT16;
}

inline int add_attribute(const GlbParts& plain, const std::string& name, const GltfWriter::Json& accessor,
                         draco::Mesh& mesh) {
  const std::string bytes = plain.bytes_of(accessor);
  const int component = accessor["componentType"].get<int>();
  const std::size_t count = accessor["count"].get<std::size_t>(), size = bytes.size() / count;
  const auto kind = name == "POSITION"     ? draco::GeometryAttribute::POSITION
                    : name == "TEXCOORD_0" ? draco::GeometryAttribute::TEX_COORD
                    : name == "COLOR_0"    ? draco::GeometryAttribute::COLOR
                                           : draco::GeometryAttribute::GENERIC;
  auto attribute = std::make_unique<draco::PointAttribute>();
  attribute->Init(kind, static_cast<std::int8_t>(width_of(accessor)), draco_type(component), false, count);
  for (std::uint32_t v = 0; v < count; ++v)
    attribute->SetAttributeValue(draco::AttributeValueIndex(v), bytes.data() + size * v);
  return mesh.AddAttribute(std::move(attribute));
}

}  // namespace packed_gltf

/// The file with the attributes and triangles of its primitive compressed by Draco's own encoder. The morph targets,
/// whose vertices keep their order in a sequential stream alone, are left out otherwise.
inline std::string draco_glb(const GltfWriter& file, const DracoPacking& packing = {}) {
  const GlbParts plain(file);
  GlbParts result = plain;
  const auto& primitive = plain.json["meshes"][0]["primitives"][0];
  auto& written = result.json["meshes"][0]["primitives"][0];
  const auto accessor_of = [&](const GltfWriter::Json& index) {
    return plain.json["accessors"][index.get<std::size_t>()];
  };
  draco::Mesh mesh;
  mesh.set_num_points(accessor_of(primitive["attributes"]["POSITION"])["count"].get<std::uint32_t>());
  const std::string bytes = plain.bytes_of(accessor_of(primitive["indices"]));
  std::vector<std::uint16_t> corners(bytes.size() / 2);
  std::memcpy(corners.data(), bytes.data(), bytes.size());
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3)
    mesh.AddFace({draco::PointIndex(corners[i]), draco::PointIndex(corners[i + 1]), draco::PointIndex(corners[i + 2])});
  GltfWriter::Json extension;
  std::optional<int> positions;
  for (const auto& [name, index] : primitive["attributes"].items()) {
    const int id = packed_gltf::add_attribute(plain, name, accessor_of(index), mesh);
    if (name == "POSITION") positions = id;
    extension["attributes"][name] = mesh.attribute(id)->unique_id();
    result.json["accessors"][index.get<std::size_t>()].erase("bufferView");
  }
  result.json["accessors"][primitive["indices"].get<std::size_t>()].erase("bufferView");
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(packing.method);
  if (packing.position_bits > 0) encoder.SetAttributeQuantization(positions.value(), packing.position_bits);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeToBuffer(&buffer).ok()) throw std::logic_error("Draco does not encode the mesh of the test");
  std::string stream(buffer.data(), buffer.size());
  packing.change(stream);
  extension["bufferView"] = result.json["bufferViews"].size();
  result.json["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", result.append(stream)}, {"byteLength", stream.size()}});
  if (packing.method == draco::MESH_EDGEBREAKER_ENCODING) written.erase("targets");
  written["extensions"]["KHR_draco_mesh_compression"] = extension;
  result.json["extensionsUsed"] = result.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return result.glb();
}

}  // namespace doppel::support
