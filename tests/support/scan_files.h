#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "doppel/core/error.h"
#include "doppel/geometry/mesh.h"

/// Files of scans, written as their formats say. Independent of the readers.
namespace doppel::support {

/// A box with 8 vertices and 12 triangles, faces outwards, with a colour at each corner (its position, 0..1) and UVs
/// that lay the x-y plane over the image.
inline TriangleMesh coloured_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  TriangleMesh mesh;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d part(k & 1, (k >> 1) & 1, (k >> 2) & 1);
    mesh.vertices.push_back(low + part.cwiseProduct(high - low));
    mesh.colours.push_back(part);
    mesh.uvs.emplace_back(part.x(), part.y());
  }
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  mesh.face_uvs = mesh.faces;
  return mesh;
}

inline std::string stl_text(const TriangleMesh& mesh) {
  std::string text = "solid box\n";
  for (const Triangle& face : mesh.faces) {
    text += "  facet normal 0 0 0\n    outer loop\n";
    for (const int v : face) {
      const Eigen::Vector3d& x = mesh.vertices[static_cast<std::size_t>(v)];
      text += fmt::format("      vertex {} {} {}\n", x.x(), x.y(), x.z());
    }
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid box\n";
}

/// The bytes of a value, in either order.
template <typename T>
void append_bytes(std::string& file, T value, bool big_endian = false) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof value);
  for (std::size_t i = 0; i < sizeof(T); ++i) file += bytes[big_endian ? sizeof(T) - 1 - i : i];
}

inline std::string stl_binary(const TriangleMesh& mesh) {
  std::string file = "a box in binary form";
  file.resize(80, ' ');
  append_bytes(file, static_cast<std::uint32_t>(mesh.faces.size()));
  for (const Triangle& face : mesh.faces) {
    for (int i = 0; i < 3; ++i) append_bytes(file, 0.0F);
    for (const int v : face)
      for (int axis = 0; axis < 3; ++axis)
        append_bytes(file, static_cast<float>(mesh.vertices[static_cast<std::size_t>(v)][axis]));
    append_bytes(file, std::uint16_t{0});
  }
  return file;
}

enum class PlyForm { text, little_endian, big_endian };
/// Where the UVs of a PLY file stand: with the vertices (`s t`), or with the corners of the faces (`texcoord`).
enum class PlyUvs { none, vertices, corners };

class PlyWriter {
 public:
  PlyWriter(const TriangleMesh& mesh, PlyForm form, PlyUvs uvs = PlyUvs::none, const std::string& texture = "")
      : mesh_(mesh), form_(form), uvs_(uvs), texture_(texture) {}

  std::string file() {
    write_header();
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) number(static_cast<float>(mesh_.vertices[v][axis]));
      if (!mesh_.colours.empty())
        for (int channel = 0; channel < 3; ++channel)
          number(static_cast<std::uint8_t>(std::lround(255 * mesh_.colours[v][channel])));
      if (uvs_ == PlyUvs::vertices)
        for (int axis = 0; axis < 2; ++axis) number(static_cast<float>(mesh_.uvs[v][axis]));
      end_row();
    }
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
      number(std::uint8_t{3});
      for (const int v : mesh_.faces[f]) number(static_cast<std::int32_t>(v));
      if (uvs_ == PlyUvs::corners) {
        number(std::uint8_t{6});
        for (const int uv : mesh_.face_uvs[f])
          for (int axis = 0; axis < 2; ++axis)
            number(static_cast<float>(mesh_.uvs[static_cast<std::size_t>(uv)][axis]));
      }
      end_row();
    }
    return text_;
  }

 private:
  void write_header() {
    const char* const forms[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    text_ = fmt::format("ply\nformat {} 1.0\n", forms[static_cast<int>(form_)]);
    if (!texture_.empty()) text_ += "comment TextureFile " + texture_ + "\n";
    text_ +=
        fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n", mesh_.vertices.size());
    if (!mesh_.colours.empty()) text_ += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    if (uvs_ == PlyUvs::vertices) text_ += "property float s\nproperty float t\n";
    text_ += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", mesh_.faces.size());
    if (uvs_ == PlyUvs::corners) text_ += "property list uchar float texcoord\n";
    text_ += "end_header\n";
  }
  template <typename T>
  void number(T value) {
    if (form_ == PlyForm::text)
      text_ += fmt::format("{} ", value);
    else
      append_bytes(text_, value, form_ == PlyForm::big_endian);
  }
  void end_row() {
    if (form_ == PlyForm::text) text_ += '\n';
  }

  const TriangleMesh& mesh_;
  PlyForm form_;
  PlyUvs uvs_;
  std::string texture_, text_;
};

/// A Collada file of one mesh with UVs and one material.
/// @param up `X_UP`, `Y_UP` or `Z_UP` @param texture a file name, or empty: the material is plain (0.2, 0.4, 0.6)
inline std::string collada_file(const TriangleMesh& mesh, double metres_per_unit, const std::string& up,
                                const std::string& texture = "") {
  std::string positions, uvs, corners;
  for (const Eigen::Vector3d& x : mesh.vertices) positions += fmt::format("{} {} {} ", x.x(), x.y(), x.z());
  for (const Eigen::Vector2d& uv : mesh.uvs) uvs += fmt::format("{} {} ", uv.x(), uv.y());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) corners += fmt::format("{} {} ", mesh.faces[f][c], mesh.face_uvs[f][c]);
  const std::string image = texture.empty() ? ""
                                            : "<library_images><image id=\"skin\"><init_from>" + texture +
                                                  "</init_from></image></library_images>\n";
  const std::string parameters =
      texture.empty()
          ? ""
          : "<newparam sid=\"surface\"><surface type=\"2D\"><init_from>skin</init_from></surface></newparam>"
            "<newparam sid=\"sampler\"><sampler2D><source>surface</source></sampler2D></newparam>";
  const std::string diffuse =
      texture.empty() ? "<color>0.2 0.4 0.6 1</color>" : "<texture texture=\"sampler\" texcoord=\"UVMap\"/>";
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
      "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\n"
      "<asset><unit name=\"unit\" meter=\"{}\"/><up_axis>{}</up_axis></asset>\n{}"
      "<library_effects><effect id=\"effect\"><profile_COMMON>{}<technique "
      "sid=\"common\"><lambert><diffuse>{}</diffuse>"
      "</lambert></technique></profile_COMMON></effect></library_effects>\n"
      "<library_materials><material id=\"cloth\" name=\"cloth\"><instance_effect url=\"#effect\"/></material>"
      "</library_materials>\n"
      "<library_geometries><geometry id=\"box\" name=\"box\"><mesh>\n"
      "<source id=\"positions\"><float_array id=\"p\" count=\"{}\">{}</float_array><technique_common>"
      "<accessor source=\"#p\" count=\"{}\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" "
      "type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>\n"
      "<source id=\"uvs\"><float_array id=\"t\" count=\"{}\">{}</float_array><technique_common>"
      "<accessor source=\"#t\" count=\"{}\" stride=\"2\"><param name=\"S\" type=\"float\"/><param name=\"T\" "
      "type=\"float\"/></accessor></technique_common></source>\n"
      "<vertices id=\"corners\"><input semantic=\"POSITION\" source=\"#positions\"/></vertices>\n"
      "<triangles material=\"symbol\" count=\"{}\"><input semantic=\"VERTEX\" source=\"#corners\" offset=\"0\"/>"
      "<input semantic=\"TEXCOORD\" source=\"#uvs\" offset=\"1\" set=\"0\"/><p>{}</p></triangles>\n"
      "</mesh></geometry></library_geometries>\n"
      "<library_visual_scenes><visual_scene id=\"scene\"><node id=\"body\" name=\"body\" type=\"NODE\">"
      "<instance_geometry url=\"#box\"><bind_material><technique_common><instance_material symbol=\"symbol\" "
      "target=\"#cloth\"/></technique_common></bind_material></instance_geometry></node></visual_scene>"
      "</library_visual_scenes>\n"
      "<scene><instance_visual_scene url=\"#scene\"/></scene></COLLADA>\n",
      metres_per_unit, up, image, parameters, diffuse, 3 * mesh.vertices.size(), positions, mesh.vertices.size(),
      2 * mesh.uvs.size(), uvs, mesh.uvs.size(), mesh.faces.size(), corners);
}

}  // namespace doppel::support
