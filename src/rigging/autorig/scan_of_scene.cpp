#include "doppel/rigging/autorig/scan_of_scene.h"

#include <algorithm>

namespace doppel {

namespace {

/// Numbers the rows whose index is not -1, copies them, and puts the numbers into the faces.
template <typename Row>
void keep_used(const std::vector<Row>& rows, std::vector<int>& index, std::vector<Row>& kept,
               std::vector<Triangle>& faces) {
  kept.reserve(std::count_if(index.begin(), index.end(), [](int i) { return i >= 0; }));
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (index[i] >= 0) {
      index[i] = static_cast<int>(kept.size());
      kept.push_back(rows[i]);
    }
  for (Triangle& face : faces)
    for (int& corner : face) corner = index[corner];
}

/// The triangles of a primitive that have one material.
/// @param textures of all materials
ScanPart part_of(const Scene& scene, const ScenePrimitive& primitive, const std::vector<Eigen::Vector3d>& vertices,
                 int material, const std::vector<cv::Mat>& textures) {
  ScanPart part;
  part.name = primitive.name;
  // The vertices that these triangles use, in the order of the file.
  std::vector<int> index(vertices.size(), -1), uv_index(primitive.uvs.size(), -1);
  for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
    if (!primitive.face_materials.empty() && primitive.face_materials[f] != material) continue;
    part.mesh.faces.push_back(primitive.faces[f]);
    for (const int v : primitive.faces[f]) index[v] = 0;
    if (primitive.face_uvs.empty()) continue;
    part.mesh.face_uvs.push_back(primitive.face_uvs[f]);
    for (const int uv : primitive.face_uvs[f]) uv_index[uv] = 0;
  }
  keep_used(vertices, index, part.mesh.vertices, part.mesh.faces);
  if (!primitive.colours.empty())
    for (std::size_t v = 0; v < index.size(); ++v)
      if (index[v] >= 0) part.mesh.colours.push_back(primitive.colours[v]);
  keep_used(primitive.uvs, uv_index, part.mesh.uvs, part.mesh.face_uvs);
  if (material < 0) return part;
  part.mesh.texture = textures[material];
  part.colour = scene.materials[material].colour.head<3>();
  return part;
}

}  // namespace

ScanParts scan_of_scene(const Scene& scene) {
  const std::vector<Eigen::Affine3d> world_from_node = node_transforms(scene);
  std::vector<cv::Mat> textures;  // parts of one material share its image
  for (const SceneMaterial& material : scene.materials) textures.push_back(coloured_texture(material));
  ScanParts scan;
  for (const ScenePrimitive& primitive : scene.primitives) {
    const std::vector<Eigen::Vector3d> vertices = posed_vertices(scene, primitive, world_from_node);
    std::vector<int> materials = primitive.face_materials;
    if (materials.empty()) materials = {primitive.material};
    std::sort(materials.begin(), materials.end());
    materials.erase(std::unique(materials.begin(), materials.end()), materials.end());
    for (const int material : materials) scan.parts.push_back(part_of(scene, primitive, vertices, material, textures));
  }
  return scan;
}

}  // namespace doppel
