#pragma once

#include <meshoptimizer.h>

#include <stdexcept>

#include "support/gltf_writer.h"

namespace doppel::support {

/// A .glb whose views EXT_meshopt_compression has compressed, as the specification unpacks them: a file with one plain
/// buffer. Shares no code with readers or writers.
inline std::string unpacked_glb(const std::string& glb) {
  using Json = GltfWriter::Json;
  std::uint32_t size = 0;
  std::memcpy(&size, glb.data() + 12, 4);
  Json json = Json::parse(glb.substr(20, size));
  const std::string packed = glb.substr(28 + size);
  std::string plain;
  for (Json& view : json["bufferViews"]) {
    plain.resize((plain.size() + 3) / 4 * 4);
    const bool compressed = view.contains("extensions");
    const Json range = compressed ? view["extensions"]["EXT_meshopt_compression"] : view;
    const auto* stream = reinterpret_cast<const unsigned char*>(packed.data()) + range["byteOffset"].get<std::size_t>();
    const std::size_t length = range["byteLength"].get<std::size_t>();
    std::string bytes(reinterpret_cast<const char*>(stream), length);
    if (compressed) {
      const std::size_t count = range["count"].get<std::size_t>(), stride = range["byteStride"].get<std::size_t>();
      bytes.assign(count * stride, '\0');
      const bool triangles = range["mode"] == "TRIANGLES";
      if ((triangles ? meshopt_decodeIndexBuffer(bytes.data(), count, stride, stream, length)
                     : meshopt_decodeVertexBuffer(bytes.data(), count, stride, stream, length)) != 0)
        throw std::runtime_error("a compressed view cannot be decoded: " + view.dump());
      if (range.value("filter", "NONE") == "EXPONENTIAL") meshopt_decodeFilterExp(bytes.data(), count, stride);
      if (bytes.size() != view["byteLength"]) throw std::runtime_error("a view has another length: " + view.dump());
    }
    view["buffer"] = 0;
    view["byteOffset"] = plain.size();
    view.erase("extensions");
    plain += bytes;
  }
  GltfWriter writer;
  writer.view({plain.begin(), plain.end()});
  writer.json = json;
  writer.json["buffers"] = {{{"byteLength", plain.size()}}};
  return writer.glb();
}

}  // namespace doppel::support
