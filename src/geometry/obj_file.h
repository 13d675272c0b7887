#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

/// What an OBJ file says. `read_obj` makes one mesh with one texture of it, `read_scene` a scene.
struct ObjFile {
  std::vector<Eigen::Vector3d> vertices;  ///< [N] scaled
  std::vector<Eigen::Vector3d> colours;   ///< [N] as the file has them, or empty
  std::vector<Eigen::Vector2d> uvs;       ///< [U]
  std::vector<Triangle> faces;            ///< [F] polygons are split into fans
  std::vector<Triangle> face_uvs;         ///< [F] indices into uvs, or {-1, -1, -1} for a face without
  std::vector<int> face_materials;        ///< [F] indices into materials; -1: none
  std::vector<int> face_lines;            ///< [F] in the file, for messages
  std::vector<std::string> materials;     ///< names of `usemtl`, each once
  std::vector<std::pair<std::filesystem::path, FileLocation>> libraries;  ///< of `mtllib`; they may not exist
};

/// A material of an MTL file. One with several `map_Kd` has an entry for each.
struct ObjMaterial {
  std::string name;
  std::optional<Eigen::Vector3d> colour;  ///< Kd, RGB 0..1
  std::filesystem::path texture;          ///< map_Kd, beside the MTL file; or empty
  std::string written_texture;            ///< the same as the file writes it
  FileLocation where;                     ///< of map_Kd
};

/// Reads an OBJ file without its materials. Normals, groups, lines and smoothing are left out.
/// @param metres_per_unit scales the positions
/// @throws FileError with the line: a bad index, a number that is not finite, no faces, a face of which only some
///   corners have texture coordinates
ObjFile read_obj_file(const std::filesystem::path& path, double metres_per_unit);

/// The materials of an MTL file with their colour and colour texture. Other properties are left out.
/// @throws FileError with the line: a number that is none, a map_Kd without a name
std::vector<ObjMaterial> read_mtl(const std::filesystem::path& path);

}  // namespace doppel
