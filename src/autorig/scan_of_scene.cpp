#include "doppel/autorig/scan_of_scene.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

/// The triangles of a primitive that have one material.
ScanPart part_of(const Scene& scene, const ScenePrimitive& primitive, const std::vector<Eigen::Vector3d>& vertices,
                 int material) {
  ScanPart part;
  part.name = primitive.name;
  part.mesh.vertices = vertices;
  part.mesh.colours = primitive.colours;
  part.mesh.uvs = primitive.uvs;
  for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
    if (!primitive.face_materials.empty() && primitive.face_materials[f] != material) continue;
    part.mesh.faces.push_back(primitive.faces[f]);
    if (!primitive.face_uvs.empty()) part.mesh.face_uvs.push_back(primitive.face_uvs[f]);
  }
  if (material < 0) return part;
  const SceneMaterial& surface = scene.materials[as_size(material)];
  part.mesh.texture = surface.texture;
  part.colour = surface.colour.head<3>();
  return part;
}

}  // namespace

ScanParts scan_of_scene(const Scene& scene) {
  const std::vector<Eigen::Affine3d> world_from_node = node_transforms(scene);
  ScanParts scan;
  for (const ScenePrimitive& primitive : scene.primitives) {
    const std::vector<Eigen::Vector3d> vertices = posed_vertices(scene, primitive, world_from_node);
    std::vector<int> materials = primitive.face_materials;
    if (materials.empty()) materials = {primitive.material};
    std::sort(materials.begin(), materials.end());
    materials.erase(std::unique(materials.begin(), materials.end()), materials.end());
    for (const int material : materials) scan.parts.push_back(part_of(scene, primitive, vertices, material));
  }
  return scan;
}

}  // namespace doppel
