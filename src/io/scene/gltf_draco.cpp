#include "doppel/io/scene/gltf_draco.h"

#include <draco/attributes/point_attribute.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <exception>
#include <type_traits>

#include "doppel/core/as_size.h"
#include "doppel/core/excerpt.h"
#include "doppel/io/scene/gltf_component.h"

namespace doppel {

namespace {

/// A vertex has a few attributes of at most four floats. And no mesh of a figure has so little in it that one byte
/// stands for this many vertices; a run of zeros takes no bytes at all.
constexpr std::size_t kMaxVertexBytes = 512, kMaxVerticesPerByte = 1024;

/// What a stream may hold.
struct DracoBounds {
  double vertices = 0, triangles = 0;
};

/// A decoder of the library that looks at the counts before it allocates for them.
template <typename Decoder>
class BoundedDracoDecoder : public Decoder {
 public:
  explicit BoundedDracoDecoder(const DracoBounds& bounds) : bounds_(bounds) {}
  const std::string& fault() const { return fault_; }

 private:
  static constexpr bool kSequential = std::is_same_v<Decoder, draco::MeshSequentialDecoder>;

  /// Both kinds begin with two counts: triangles and vertices, or the other way round.
  bool DecodeConnectivity() override {
    draco::DecoderBuffer ahead = *this->buffer();
    std::uint32_t first = 0, second = 0;
    if (!draco::DecodeVarint(&first, &ahead) || !draco::DecodeVarint(&second, &ahead)) return false;
    const std::uint32_t triangles = kSequential ? first : second, vertices = kSequential ? second : first;
    return within(vertices, bounds_.vertices, "vertices") && within(triangles, bounds_.triangles, "triangles") &&
           Decoder::DecodeConnectivity();
  }

  /// Types of the attributes are known, and none of their values is read.
  bool DecodeAllAttributes() override {
    const draco::PointCloud& cloud = *this->point_cloud();
    std::size_t bytes = 0;
    for (int i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      bytes += as_size(attribute.num_components()) * as_size(draco::DataTypeLength(attribute.data_type()));
    }
    if (bytes > kMaxVertexBytes)
      fault_ = fmt::format("has {} bytes for each vertex; at most {} are read", bytes, kMaxVertexBytes);
    return fault_.empty() && within(cloud.num_points(), bounds_.vertices, "vertices") && Decoder::DecodeAllAttributes();
  }

  bool within(std::uint32_t count, double bound, const char* what) {
    if (count <= bound) return true;
    fault_ =
        fmt::format("holds {} {}, but its accessors and its size allow {}: the file is damaged", count, what, bound);
    return false;
  }

  DracoBounds bounds_;
  std::string fault_;
};

template <typename Decoder>
std::string decode_draco_as(draco::DecoderBuffer& buffer, const DracoBounds& bounds, draco::Mesh& mesh) {
  BoundedDracoDecoder<Decoder> decoder(bounds);
  const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, &mesh);
  if (status.ok()) return {};
  return decoder.fault().empty() ? "cannot be decoded: the file is truncated or damaged" : decoder.fault();
}

/// @return why the stream is not read; empty when it is
std::string decode_draco(std::string_view stream, const DracoBounds& bounds, draco::Mesh& mesh) {
  draco::DecoderBuffer buffer, ahead;
  buffer.Init(stream.data(), stream.size());
  ahead = buffer;
  draco::DracoHeader header;
  if (!draco::PointCloudDecoder::DecodeHeader(&ahead, &header).ok()) return "is none: it does not begin as one";
  if (header.version_major != 2 || header.version_minor != 2)
    return fmt::format(
        "has version {}.{}; glTF has version 2.2. Compress the file anew, e.g. by `gltf-transform draco`",
        header.version_major, header.version_minor);
  if (header.encoder_type != draco::TRIANGULAR_MESH) return "holds points, not triangles";
  try {
    return header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING
               ? decode_draco_as<draco::MeshEdgebreakerDecoder>(buffer, bounds, mesh)
               : decode_draco_as<draco::MeshSequentialDecoder>(buffer, bounds, mesh);
  } catch (const std::exception& problem) {  // of the standard library, for a size that makes no sense
    return fmt::format("cannot be decoded ({}): the file is damaged", problem.what());
  }
}

/// The glTF type of a component; 0 for one that glTF does not have.
int component_type(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return 5120;
    case draco::DT_UINT8:
      return 5121;
    case draco::DT_INT16:
      return 5122;
    case draco::DT_UINT16:
      return 5123;
    case draco::DT_UINT32:
      return 5125;
    case draco::DT_FLOAT32:
      return 5126;
    default:
      return 0;
  }
}

/// The values of an attribute for each vertex.
/// @param attribute of a mesh with `count` vertices @return no rows where it has none for some vertex
GltfNumbers values_of(const draco::PointAttribute& attribute, std::size_t count, bool normalized) {
  const int type = component_type(attribute.data_type());
  const std::size_t size = component_size(type);
  GltfNumbers numbers{count, as_size(attribute.num_components()), {}};
  numbers.values.reserve(count * numbers.width);
  for (std::uint32_t v = 0; v < count; ++v) {
    const auto value = attribute.mapped_index(draco::PointIndex(v));
    const std::size_t start = as_size(attribute.byte_offset() + attribute.byte_stride() * std::int64_t{value.value()});
    if (value.value() >= attribute.size() || start + size * numbers.width > attribute.buffer()->data_size()) return {};
    const auto* bytes = reinterpret_cast<const char*>(attribute.buffer()->data()) + start;
    for (std::size_t c = 0; c < numbers.width; ++c)
      numbers.values.push_back(component_value(bytes + c * size, type, normalized));
  }
  return numbers;
}

std::vector<Triangle> faces_of(const draco::Mesh& mesh) {
  std::vector<Triangle> faces;
  faces.reserve(mesh.num_faces());
  for (std::uint32_t f = 0; f < mesh.num_faces(); ++f) {
    Triangle face;
    for (std::size_t c = 0; c < 3; ++c) face[c] = static_cast<int>(mesh.face(draco::FaceIndex(f))[c].value());
    faces.push_back(face);
  }
  return faces;
}

/// The counts that the accessors of a primitive state.
DracoBounds stated_bounds(const GltfFile& file, const GltfFile::Json& primitive, const SceneLimits& limits,
                          std::size_t bytes, const std::string& where) {
  const GltfFile::Json& accessors = file.list("accessors");
  const auto count = [&](const GltfFile::Json& of, const char* name) {
    return file.number(accessors[file.index(of, name, accessors.size(), where, true)], "count", 0, where);
  };
  DracoBounds bounds;
  const double vertices = count(file.object(primitive, "attributes"), "POSITION"),
               corners = count(primitive, "indices");
  bounds.vertices = std::min({vertices, static_cast<double>(limits.vertices),
                              static_cast<double>(bytes) * static_cast<double>(kMaxVerticesPerByte)});
  bounds.triangles = std::min({corners / 3, static_cast<double>(limits.triangles), 3 * bounds.vertices + 3});
  return bounds;
}

}  // namespace

DracoPrimitive read_draco(const GltfFile& file, const GltfFile::Json& primitive, const SceneLimits& limits,
                          const std::string& where) {
  const GltfFile::Json& extension = file.object(file.object(primitive, "extensions"), "KHR_draco_mesh_compression");
  const GltfFile::Json &names = file.object(extension, "attributes"), &accessors = file.list("accessors");
  const std::string_view stream = file.bytes_of_view(
      file.index(extension, "bufferView", file.list("bufferViews").size(), where + ".KHR_draco_mesh_compression", true),
      where);
  draco::Mesh mesh;
  const std::string fault = decode_draco(stream, stated_bounds(file, primitive, limits, stream.size(), where), mesh);
  if (!fault.empty()) file.fail_here("the Draco stream of {} {}", where, fault);
  DracoPrimitive result;
  result.faces = faces_of(mesh);
  file.count_values(3.0 * static_cast<double>(mesh.num_faces()));
  for (const auto& [name, id] : names.items()) {
    const draco::PointAttribute* attribute =
        id.is_number_unsigned() ? mesh.GetAttributeByUniqueId(id.get<std::uint32_t>()) : nullptr;
    const std::string shown = excerpt(name, 40);
    if (!attribute)
      file.fail_here("the Draco stream of {} lacks the attribute {} ({})", where, excerpt(id.dump(), 20), shown);
    if (component_type(attribute->data_type()) == 0 || attribute->num_components() == 0)
      file.fail_here("{} in the Draco stream of {} has numbers of a type that glTF does not have", shown, where);
    const int accessor = file.index(file.object(primitive, "attributes"), name.c_str(), accessors.size(), where, true);
    file.count_values(static_cast<double>(mesh.num_points()) * static_cast<double>(attribute->num_components()));
    const bool normalized = accessors[accessor].contains("normalized") && accessors[accessor]["normalized"] == true;
    GltfNumbers numbers = values_of(*attribute, mesh.num_points(), normalized);
    if (numbers.count != mesh.num_points())
      file.fail_here("{} in the Draco stream of {} has no values for some vertices: the file is damaged", shown, where);
    result.attributes.emplace(name, std::move(numbers));
  }
  return result;
}

}  // namespace doppel
