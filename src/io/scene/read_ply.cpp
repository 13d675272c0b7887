#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/ply_file.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/scene_images.h"

namespace doppel {

namespace {

/// What a property of a vertex means. Files of scanners differ in the names.
enum class PlyRole { other, x, y, z, red, green, blue, u, v };

PlyRole role_of(const std::string& name) {
  static const std::pair<const char*, PlyRole> kRoles[] = {{"x", PlyRole::x},
                                                           {"y", PlyRole::y},
                                                           {"z", PlyRole::z},
                                                           {"red", PlyRole::red},
                                                           {"green", PlyRole::green},
                                                           {"blue", PlyRole::blue},
                                                           {"r", PlyRole::red},
                                                           {"g", PlyRole::green},
                                                           {"b", PlyRole::blue},
                                                           {"diffuse_red", PlyRole::red},
                                                           {"diffuse_green", PlyRole::green},
                                                           {"diffuse_blue", PlyRole::blue},
                                                           {"u", PlyRole::u},
                                                           {"v", PlyRole::v},
                                                           {"s", PlyRole::u},
                                                           {"t", PlyRole::v},
                                                           {"texture_u", PlyRole::u},
                                                           {"texture_v", PlyRole::v}};
  for (const auto& [known, role] : kRoles)
    if (name == known) return role;
  return PlyRole::other;
}

/// What 1 is in the numbers of a type: 255 in bytes.
double full_scale(PlyProperty::Type type) {
  if (ply_is_float(type)) return 1.0;
  return ply_size(type) == 1 ? 255.0 : ply_size(type) == 2 ? 65535.0 : 255.0;
}

class PlyReader {
 public:
  PlyReader(const std::filesystem::path& path, const SceneLimits& limits) : path_(path), limits_(limits), file_(path) {}

  Scene read() {
    for (const PlyElement& element : file_.elements()) {
      if (element.name == "vertex")
        read_vertices(element);
      else if (element.name == "face")
        read_faces(element);
      else
        for (std::size_t row = 0; row < element.count; ++row) skip_row(element);
    }
    if (file_has("tristrips") && primitive_.faces.empty())
      file_.fail_here("the file holds strips of triangles, which are not read; export it with faces");
    finish_uvs();
    read_materials();
    scene_.nodes.emplace_back().name = path_.stem().string();
    primitive_.name = scene_.nodes[0].name;
    scene_.primitives.push_back(std::move(primitive_));
    return std::move(scene_);
  }

 private:
  bool file_has(const char* name) const {
    return std::any_of(file_.elements().begin(), file_.elements().end(),
                       [&](const PlyElement& element) { return element.name == name; });
  }
  void skip_row(const PlyElement& element) {
    for (const PlyProperty& property : element.properties) skip(property);
  }
  void skip(const PlyProperty& property) {
    std::size_t count = property.is_list ? file_.next_count(property) : 1;
    while (count-- > 0) file_.next(property.type);
  }
  void read_vertices(const PlyElement& element);
  void read_faces(const PlyElement& element);
  void read_list(const PlyProperty& property, std::vector<double>& values);
  void add_polygon(const std::vector<double>& corners, const std::vector<double>& uvs, int material);
  void finish_uvs();
  void read_materials();

  std::filesystem::path path_;
  SceneLimits limits_;
  PlyFile file_;
  Scene scene_;
  ScenePrimitive primitive_;
  std::vector<Eigen::Vector2d> vertex_uvs_;
};

void PlyReader::read_vertices(const PlyElement& element) {
  if (element.count > as_size(limits_.vertices))
    file_.fail_here("the file has {} vertices; at most {} are read", element.count, limits_.vertices);
  std::vector<PlyRole> roles;
  for (const PlyProperty& property : element.properties)
    roles.push_back(property.is_list ? PlyRole::other : role_of(property.name));
  const auto has = [&](PlyRole role) { return std::find(roles.begin(), roles.end(), role) != roles.end(); };
  for (const PlyRole axis : {PlyRole::x, PlyRole::y, PlyRole::z})
    if (!has(axis)) file_.fail_here("the vertices have no property '{}'", "xyz"[static_cast<int>(axis) - 1]);
  const bool coloured = has(PlyRole::red) && has(PlyRole::green) && has(PlyRole::blue);
  const bool with_uvs = has(PlyRole::u) && has(PlyRole::v);
  primitive_.vertices.reserve(element.count);
  for (std::size_t row = 0; row < element.count; ++row) {
    std::array<double, 9> values{};
    for (std::size_t p = 0; p < roles.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      const bool colour = roles[p] == PlyRole::red || roles[p] == PlyRole::green || roles[p] == PlyRole::blue;
      if (roles[p] == PlyRole::other)
        skip(property);
      else
        values[static_cast<std::size_t>(roles[p])] =
            file_.next(property.type) / (colour ? full_scale(property.type) : 1.0);
    }
    primitive_.vertices.emplace_back(values[1], values[2], values[3]);
    if (coloured) primitive_.colours.emplace_back(values[4], values[5], values[6]);
    if (with_uvs) vertex_uvs_.emplace_back(values[7], values[8]);
  }
}

void PlyReader::read_list(const PlyProperty& property, std::vector<double>& values) {
  values.clear();
  for (std::size_t count = property.is_list ? file_.next_count(property) : 1; count > 0; --count)
    values.push_back(file_.next(property.type));
}

void PlyReader::read_faces(const PlyElement& element) {
  std::vector<double> corners, uvs, number, rest;
  for (std::size_t row = 0; row < element.count; ++row) {
    corners.clear();
    uvs.clear();
    number.clear();
    for (const PlyProperty& property : element.properties) {
      const bool list = property.is_list;
      read_list(property, list && (property.name == "vertex_indices" || property.name == "vertex_index") ? corners
                          : list && property.name == "texcoord"                                          ? uvs
                          : !list && property.name == "texnumber"                                        ? number
                                                                                                         : rest);
    }
    const auto textures = static_cast<double>(file_.textures().size());
    const bool known = !number.empty() && number[0] >= 0 && number[0] < textures;
    add_polygon(corners, uvs, known ? static_cast<int>(number[0]) : textures > 0 ? 0 : -1);
  }
}

void PlyReader::add_polygon(const std::vector<double>& corners, const std::vector<double>& uvs, int material) {
  std::vector<int> polygon;
  for (const double corner : corners) {
    if (!(corner >= 0) || corner > 2e9 || corner != std::floor(corner))
      file_.fail_here("a face names vertex {}; vertices count from 0", corner);
    polygon.push_back(static_cast<int>(corner));
  }
  if (primitive_.faces.size() + polygon.size() > as_size(limits_.triangles) + 2)
    file_.fail_here("the file has more than {} triangles, which is the most that is read", limits_.triangles);
  const int first = static_cast<int>(primitive_.uvs.size());
  const bool with_uvs = !uvs.empty() && uvs.size() == 2 * polygon.size();
  for (std::size_t i = 0; with_uvs && i < uvs.size(); i += 2) primitive_.uvs.emplace_back(uvs[i], uvs[i + 1]);
  split_polygon(static_cast<int>(polygon.size()), [&](int a, int b, int c) {
    primitive_.faces.push_back({polygon[a], polygon[b], polygon[c]});
    if (material >= 0) primitive_.face_materials.push_back(material);
    if (!with_uvs) return;
    primitive_.face_uvs.resize(primitive_.faces.size(), Triangle{-1, -1, -1});
    primitive_.face_uvs.back() = {first + a, first + b, first + c};
  });
}

/// UVs of the corners where there are some, else those of the vertices.
void PlyReader::finish_uvs() {
  // A second element of vertices may have other properties than the first.
  if (primitive_.colours.size() != primitive_.vertices.size()) primitive_.colours.clear();
  if (!primitive_.uvs.empty()) {
    primitive_.face_uvs.resize(primitive_.faces.size(), Triangle{-1, -1, -1});
    complete_face_uvs(primitive_);
  } else if (!vertex_uvs_.empty() && vertex_uvs_.size() == primitive_.vertices.size()) {
    primitive_.uvs = std::move(vertex_uvs_);
    primitive_.face_uvs = primitive_.faces;
  }
}

void PlyReader::read_materials() {
  SceneImages images(path_, limits_);
  for (const std::string& texture : file_.textures()) {
    SceneMaterial material{texture, Eigen::Vector4d::Ones(), images.of_file(texture), texture};
    if (material.texture.empty())
      scene_.warnings.push_back(fmt::format("the texture '{}' is missing or cannot be decoded", texture.substr(0, 80)));
    scene_.materials.push_back(std::move(material));
  }
  single_material(primitive_);
}

}  // namespace

Scene read_ply(const std::filesystem::path& path, const SceneLimits& limits) { return PlyReader(path, limits).read(); }

}  // namespace doppel
