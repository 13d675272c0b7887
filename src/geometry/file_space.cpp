#include "doppel/geometry/file_space.h"

namespace doppel {

TriangleMesh in_space(TriangleMesh mesh, const FileSpace& space) {
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = space.of(vertex);
  return mesh;
}

}  // namespace doppel
