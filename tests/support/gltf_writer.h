#pragma once

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace doppel::support {

/// Builds small glTF files. Members of `json` can be changed at will before writing, to damage the file.
class GltfWriter {
 public:
  using Json = nlohmann::json;
  Json json = {{"asset", {{"version", "2.0"}}},
               {"nodes", Json::array()},
               {"accessors", Json::array()},
               {"bufferViews", Json::array()}};

  int floats(const std::vector<float>& values, const char* type, int width) {
    return add(values.data(), 4 * values.size(), 5126, type, values.size() / static_cast<std::size_t>(width));
  }
  int bytes(const std::vector<std::uint8_t>& values, const char* type, int width) {
    return add(values.data(), values.size(), 5121, type, values.size() / static_cast<std::size_t>(width));
  }
  int shorts(const std::vector<std::uint16_t>& values) {
    return add(values.data(), 2 * values.size(), 5123, "SCALAR", values.size());
  }
  /// The bytes of an image as a buffer view.
  int view(const std::vector<std::uint8_t>& data) {
    while (buffer_.size() % 4) buffer_ += '\0';
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", data.size()}});
    buffer_.append(reinterpret_cast<const char*>(data.data()), data.size());
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  /// The file as the bytes of a .glb.
  std::string glb() const {
    Json whole = json;
    if (!whole.contains("buffers")) whole["buffers"] = {{{"byteLength", buffer_.size()}}};
    std::string text = whole.dump(), data = buffer_;
    while (text.size() % 4) text += ' ';
    while (data.size() % 4) data += '\0';
    std::string file;
    for (const std::size_t word : {std::size_t{0x46546C67}, std::size_t{2}, 28 + text.size() + data.size(), text.size(),
                                   std::size_t{0x4E4F534A}})
      append(file, word);
    file += text;
    append(file, data.size());
    append(file, 0x004E4942);
    return file + data;
  }
  void write(const std::filesystem::path& path) const { write(path, glb()); }
  static void write(const std::filesystem::path& path, const std::string& content) {
    std::ofstream(path, std::ios::binary) << content;
  }

 private:
  static void append(std::string& file, std::size_t word) {
    for (int i = 0; i < 4; ++i) file += static_cast<char>((word >> (8 * i)) & 0xFF);
  }
  int add(const void* data, std::size_t size, int component, const char* type, std::size_t count) {
    const auto* first = static_cast<const std::uint8_t*>(data);
    const int where = view(std::vector<std::uint8_t>(first, first + size));
    json["accessors"].push_back(
        {{"bufferView", where}, {"componentType", component}, {"type", type}, {"count", count}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  std::string buffer_;
};

/// An arm: two joints along y, `upper` at the origin and `lower` at height 1, and a triangle on each, the second half
/// on both. One animation, `bend`, turns `lower` by 90 degrees about z within a second.
inline GltfWriter bending_arm() {
  GltfWriter file;
  const int positions = file.floats({0, 0, 0, 0.1F, 0, 0, 0, 0.5F, 0, 0, 1, 0, 0.1F, 1, 0, 0, 2, 0}, "VEC3", 3);
  const int joints = file.bytes({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 4);
  const int weights =
      file.floats({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5F, 0.5F, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 4);
  const int indices = file.shorts({0, 1, 2, 3, 4, 5});
  const int matrices = file.floats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,  //
                                    1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
                                   "MAT4", 16);
  const float half = 0.70710678F;
  const int times = file.floats({0, 1}, "SCALAR", 1), turns = file.floats({0, 0, 0, 1, 0, 0, half, half}, "VEC4", 4);
  file.json["nodes"] = {{{"name", "upper"}, {"children", {1}}},
                        {{"name", "lower"}, {"translation", {0, 1, 0}}},
                        {{"name", "arm"}, {"mesh", 0}, {"skin", 0}}};
  file.json["meshes"] = {{{"primitives",
                           {{{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
                             {"indices", indices}}}}}};
  file.json["skins"] = {{{"joints", {0, 1}}, {"inverseBindMatrices", matrices}}};
  file.json["animations"] = {{{"name", "bend"},
                              {"samplers", {{{"input", times}, {"output", turns}}}},
                              {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "rotation"}}}}}}}};
  return file;
}

}  // namespace doppel::support
