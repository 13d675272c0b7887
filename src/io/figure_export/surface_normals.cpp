#include "doppel/io/figure_export/surface_normals.h"

namespace doppel {

std::vector<Eigen::Vector3d> surface_normals(const TriangleMesh& mesh, const Eigen::MatrixX3f* moved) {
  TriangleMesh copy;
  copy.vertices = mesh.vertices;
  copy.faces = mesh.faces;
  for (std::size_t v = 0; moved && v < copy.vertices.size(); ++v)
    copy.vertices[v] += moved->row(static_cast<Eigen::Index>(v)).cast<double>().transpose();
  std::vector<Eigen::Vector3d> normals = vertex_normals(copy);
  for (Eigen::Vector3d& normal : normals)
    if (normal.squaredNorm() < 0.5) normal = Eigen::Vector3d::UnitY();
  return normals;
}

}  // namespace doppel
