#include <algorithm>
#include <map>

#include "doppel/geometry/obj_file.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/scene_images.h"

namespace doppel {

namespace {

/// The materials that the faces use, by name; those that no library knows are plain.
void read_libraries(const std::filesystem::path& path, const ObjFile& file, const SceneLimits& limits, Scene& scene) {
  std::map<std::string, ObjMaterial> known;
  for (const auto& [library, where] : file.libraries) {
    std::error_code none;
    if (!std::filesystem::is_regular_file(library, none)) {
      scene.warnings.push_back(fmt::format("the material file '{}' is missing", library.filename().string()));
      continue;
    }
    for (ObjMaterial& material : read_mtl(library)) known.try_emplace(material.name, std::move(material));
  }
  SceneImages images(path, limits);
  for (const std::string& name : file.materials) {
    SceneMaterial material{name, Eigen::Vector4d::Ones(), {}};
    if (const auto found = known.find(name); found != known.end()) {
      const ObjMaterial& from = found->second;
      if (!from.written_texture.empty()) {
        material.texture_file = from.written_texture;
        material.texture = images.of_file(from.written_texture);
        if (material.texture.empty())
          scene.warnings.push_back(
              fmt::format("the texture '{}' of material '{}' is missing or cannot be decoded; its colour is used",
                          from.written_texture.substr(0, 80), name.substr(0, 80)));
      }
      // With a texture, exporters write any diffuse colour, black too.
      if (material.texture.empty() && from.colour) material.colour.head<3>() = *from.colour;
    }
    scene.materials.push_back(std::move(material));
  }
}

}  // namespace

Scene read_obj_scene(const std::filesystem::path& path, const SceneLimits& limits) {
  ObjFile file = read_obj_file(path, 1.0);
  Scene scene;
  scene.nodes.emplace_back().name = path.stem().string();
  read_libraries(path, file, limits, scene);
  ScenePrimitive primitive;
  primitive.name = scene.nodes[0].name;
  primitive.vertices = std::move(file.vertices);
  primitive.faces = std::move(file.faces);
  primitive.colours = std::move(file.colours);
  if (std::any_of(file.face_uvs.begin(), file.face_uvs.end(), [](const Triangle& face) { return face[0] >= 0; })) {
    primitive.uvs = std::move(file.uvs);
    primitive.face_uvs = std::move(file.face_uvs);
    complete_face_uvs(primitive);
  }
  primitive.face_materials = std::move(file.face_materials);
  single_material(primitive);
  scene.primitives.push_back(std::move(primitive));
  return scene;
}

}  // namespace doppel
