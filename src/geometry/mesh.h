#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace doppel {

using Triangle = std::array<int, 3>;

/// A triangle mesh as plain arrays: N vertices, F faces, UVs per corner.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;  ///< [N] metres
  std::vector<Triangle> faces;            ///< [F] vertex indices, counter-clockwise from outside
  std::vector<Eigen::Vector3d> colours;   ///< [N] RGB 0..1, or empty
  std::vector<Eigen::Vector2d> uvs;       ///< [U] u right, v up (OBJ convention: texel row = (1-v) * height), or empty
  std::vector<Triangle> face_uvs;         ///< [F] indices into uvs, or empty
  cv::Mat texture;                        ///< 8-bit BGR, or empty

  int num_vertices() const { return static_cast<int>(vertices.size()); }
  int num_faces() const { return static_cast<int>(faces.size()); }
};

/// Reads an OBJ file with its MTL and texture. Polygons are split into fans of triangles, and the colours of
/// `v x y z r g b` lines are read.
/// @param metres_per_unit scales the positions (0.001 for Skeletool files)
/// @throws FileError with the line: bad index, NaN, no faces, a texture that the MTL names but that is missing, ...
TriangleMesh read_obj(const std::filesystem::path& path, double metres_per_unit);
/// The name of the material in the files of write_obj.
inline constexpr const char* kObjMaterial = "material_0";
/// Writes an OBJ file. If the mesh has a texture, `<stem>.mtl` and `<stem>.png` are written beside it.
void write_obj(const std::filesystem::path& path, const TriangleMesh& mesh, double metres_per_unit);

/// Area-weighted vertex normals of unit length [N]; zero for a vertex without area.
std::vector<Eigen::Vector3d> vertex_normals(const TriangleMesh& mesh);

}  // namespace doppel
