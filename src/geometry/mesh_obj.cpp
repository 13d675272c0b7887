#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "doppel/geometry/encoded_image.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/mesh.h"
#include "doppel/geometry/obj_file.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

cv::Mat read_texture(const ObjMaterial& material) {
  if (!fs::is_regular_file(material.texture))
    fail_at(material.where, "the texture {} does not exist", material.texture.string());
  const std::string bytes = read_file(material.texture);
  // Texture coordinates belong to the pixels as stored, so programs for meshes ignore EXIF orientations.
  cv::Mat image = decode_image(bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty())
    fail_at(material.where, "the texture {} cannot be decoded, or has more than {} pixels", material.texture.string(),
            kMaxImagePixels);
  return image;
}

/// The one texture that the materials in use name.
cv::Mat texture_of(const fs::path& path, const ObjFile& file) {
  std::vector<ObjMaterial> textures;
  for (const auto& [library, where] : file.libraries) {
    if (!fs::is_regular_file(library)) {
      log::warn("{}: the material file {} does not exist; the mesh has no texture", where.to_string(),
                library.string());
      continue;
    }
    for (const ObjMaterial& material : read_mtl(library)) {
      const auto& names = file.materials;
      const bool used = names.empty() || std::find(names.begin(), names.end(), material.name) != names.end();
      const bool known = std::any_of(textures.begin(), textures.end(),
                                     [&](const ObjMaterial& t) { return t.texture == material.texture; });
      if (used && !known && !material.texture.empty()) textures.push_back(material);
    }
  }
  if (textures.size() > 1)
    fail_at(textures[1].where, "the mesh {} uses {} textures, Doppel's meshes have one; bake them into one image",
            path.string(), textures.size());
  return textures.empty() ? cv::Mat() : read_texture(textures.front());
}

std::string obj_text(const TriangleMesh& mesh, double metres_per_unit, const std::string& material_file) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  if (!material_file.empty()) fmt::format_to(out, "mtllib {}\nusemtl {}\n", material_file, kObjMaterial);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d v = mesh.vertices[i] / metres_per_unit;
    fmt::format_to(out, "v {} {} {}", v.x(), v.y(), v.z());
    if (!mesh.colours.empty())
      fmt::format_to(out, " {} {} {}", mesh.colours[i].x(), mesh.colours[i].y(), mesh.colours[i].z());
    fmt::format_to(out, "\n");
  }
  for (const Eigen::Vector2d& uv : mesh.uvs) fmt::format_to(out, "vt {} {}\n", uv.x(), uv.y());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    fmt::format_to(out, "f");
    for (int corner = 0; corner < 3; ++corner) {
      fmt::format_to(out, " {}", mesh.faces[f][corner] + 1);
      if (!mesh.face_uvs.empty()) fmt::format_to(out, "/{}", mesh.face_uvs[f][corner] + 1);
    }
    fmt::format_to(out, "\n");
  }
  return fmt::to_string(text);
}

}  // namespace

TriangleMesh read_obj(const fs::path& path, double metres_per_unit) {
  if (!(metres_per_unit > 0))
    fail("reading {}: metres per unit is {}, it must be positive", path.string(), metres_per_unit);
  ObjFile file = read_obj_file(path, metres_per_unit);
  const auto with_uvs = [&](std::size_t f) { return file.face_uvs[f][0] >= 0; };
  for (std::size_t f = 1; f < file.faces.size(); ++f)
    if (with_uvs(f) != with_uvs(0))
      fail_at({path.string(), file.face_lines[f]},
              "reading a mesh: some corners have texture coordinates and some have none; give all of them or none");
  TriangleMesh mesh;
  if (with_uvs(0)) {
    mesh.face_uvs = std::move(file.face_uvs);
    mesh.texture = texture_of(path, file);
  }
  mesh.vertices = std::move(file.vertices);
  mesh.colours = std::move(file.colours);
  mesh.uvs = std::move(file.uvs);
  mesh.faces = std::move(file.faces);
  return mesh;
}

void write_obj(const fs::path& path, const TriangleMesh& mesh, double metres_per_unit) {
  if (!(metres_per_unit > 0))
    fail("writing {}: metres per unit is {}, it must be positive", path.string(), metres_per_unit);
  if (!mesh.colours.empty() && mesh.colours.size() != mesh.vertices.size()) {
    fail("writing {}: found {} colours for {} vertices", path.string(), mesh.colours.size(), mesh.vertices.size());
  }
  if (!mesh.face_uvs.empty() && mesh.face_uvs.size() != mesh.faces.size()) {
    fail("writing {}: found texture coordinates of {} faces for {} faces", path.string(), mesh.face_uvs.size(),
         mesh.faces.size());
  }
  std::string material_file;
  if (!mesh.texture.empty()) {
    const fs::path texture = fs::path(path).replace_extension(".png"),
                   material = fs::path(path).replace_extension(".mtl");
    write_image(texture, mesh.texture);
    write_atomically(material, fmt::format("newmtl {}\nmap_Kd {}\n", kObjMaterial, texture.filename().string()));
    material_file = material.filename().string();
  }
  write_atomically(path, obj_text(mesh, metres_per_unit, material_file));
}

}  // namespace doppel
