#pragma once

#include <map>
#include <string>
#include <vector>

#include "doppel/geometry/topology.h"
#include "doppel/io/scene/gltf_file.h"

namespace doppel {

/// The triangles and attributes of a primitive that KHR_draco_mesh_compression holds. Draco orders vertices anew, so
/// their index is that of the compressed file.
struct DracoPrimitive {
  std::vector<Triangle> faces;                    ///< [F] below the count of each attribute
  std::map<std::string, GltfNumbers> attributes;  ///< by the names of glTF, [N] rows each
};

/// Decodes a primitive.
/// @param primitive with the extension; its accessors state how many vertices and triangles there are, at most
/// @param where the primitive, for messages
/// @throws FileError for a damaged stream, or one that holds more than the accessors state or the limits allow
DracoPrimitive read_draco(const GltfFile& file, const GltfFile::Json& primitive, const SceneLimits& limits,
                          const std::string& where);

}  // namespace doppel
