#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/geometry/topology.h"

namespace doppel {

/// One offset for each vertex of a template, in the rest pose, that explains residuals of many frames:
///
///   sum_i w_i (r_i + g_i . d_v(i))^2 + smoothness sum_edges |d_a - d_b|^2 + stay sum_v |d_v|^2
///
/// over the offsets d. Vertices without residuals follow their neighbours.
class SurfaceOffset {
 public:
  explicit SurfaceOffset(const TriangleMesh& mesh);
  /// Adds a residual. @param gradient d residual / d position of the vertex in the rest pose
  void add(int vertex, const Eigen::Vector3d& gradient, double residual, double weight);
  /// The offsets, [N] metres. @param smoothness, stay per squared metre @throws Error when they do not determine one
  std::vector<Eigen::Vector3d> solve(double smoothness, double stay) const;

 private:
  MeshTopology topology_;
  std::vector<Eigen::Matrix3d> hessian_;   ///< [N] sum of w g g^T
  std::vector<Eigen::Vector3d> gradient_;  ///< [N] sum of w r g
};

}  // namespace doppel
