#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// A sheet under the feet: a floor, a disc, a turntable.
struct FloorSheet {
  double level = 0.0;      ///< along `up`
  double thickness = 0.0;  ///< the sheet lies within level +- thickness
  double area = 0.0;
  std::vector<int> faces;  ///< of the sheet, ascending
};

/// Finds a level sheet at the lower end of a mesh that reaches beyond what stands on it. Soles and the underside of a
/// long dress do not. Its size is compared with that of the mesh.
/// @param up unit vector @param low, high the extent of the mesh along `up`
/// @param size the largest extent of the mesh along any axis
std::optional<FloorSheet> find_floor(const TriangleMesh& mesh, const Eigen::Vector3d& up, double low, double high,
                                     double size);

}  // namespace doppel
