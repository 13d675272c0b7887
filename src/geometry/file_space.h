#pragma once

#include <Eigen/Core>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The unit of length and the vertical axis of a file whose format states neither, such as OBJ.
struct FileSpace {
  double metres_per_unit = 1.0;
  bool z_up = false;  ///< false: y is up, as in memory. true: x stays, and y is what was -z

  /// A point of the file. @param point world metres, y up
  Eigen::Vector3d of(const Eigen::Vector3d& point) const {
    // 0 - z, because files would show -0.
    return (z_up ? Eigen::Vector3d(point.x(), 0.0 - point.z(), point.y()) : point) / metres_per_unit;
  }
};

/// A mesh whose vertices are points of the file. @param mesh world metres, y up
TriangleMesh in_space(TriangleMesh mesh, const FileSpace& space);

}  // namespace doppel
