#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <iosfwd>
#include <string>

#include "doppel/io/figure_export/write_figure.h"

namespace doppel {

/// The text of `format(out, item)` for each item, with commas between them, in brackets.
template <typename Items, typename Format>
std::string usda_list(const Items& items, const Format& format) {
  std::string text = "[";
  for (const auto& item : items) {
    if (text.size() > 1) text += ", ";
    format(text, item);
  }
  return text + "]";
}

/// A name that USD takes: letters, digits and underscores, no digit first.
std::string usda_name(const std::string& name);

/// The metadata of a layer: root prim, metres, y up, times in frames of the clip.
std::string usda_layer(const std::string& root, const FigureClip& clip);

/// The prim metadata of the surface. @param schemas the API schemas besides that of the material
std::string usda_surface_schemas(bool textured, const std::string& schemas);

/// How a model of its own begins: `def TYPE "ROOT"` with its metadata, up to the brace.
std::string usda_root(const char* type, const std::string& root);

/// The faces and UVs of the surface, seen from both sides, and the binding of its material if it is textured.
std::string usda_topology(const std::string& root, const TriangleMesh& mesh, bool textured);

/// A material with the texture. @param texture name of the image beside the file
std::string usda_material(const std::string& root, const std::string& texture);

/// Unit normals of the mesh with other vertices, as a list; upwards for vertices without area. @param vertices [3N]
std::string usda_normals(const TriangleMesh& mesh, const std::vector<float>& vertices);

/// The lowest and the highest corner of the box around the vertices, as a list. @param vertices [3N], not empty
std::string usda_extent(const std::vector<float>& vertices);

/// The positions as single numbers, [3N].
std::vector<float> flat_vertices(const std::vector<Eigen::Vector3d>& positions);

/// Whether the surface has a texture, which is written beside `path` as the image of that name.
bool write_usda_texture(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& name);

/// Writes a text file atomically. @throws Error when the disk is full
void write_usda_text(const std::filesystem::path& path, const std::function<void(std::ostream&)>& write);

}  // namespace doppel
