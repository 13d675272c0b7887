#include "doppel/track/refine/surface_offset.h"

#include <Eigen/SparseCholesky>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

SurfaceOffset::SurfaceOffset(const TriangleMesh& mesh)
    : topology_(mesh),
      hessian_(as_size(mesh.num_vertices()), Eigen::Matrix3d::Zero()),
      gradient_(as_size(mesh.num_vertices()), Eigen::Vector3d::Zero()) {}

void SurfaceOffset::add(int vertex, const Eigen::Vector3d& gradient, double residual, double weight) {
  hessian_[vertex] += weight * gradient * gradient.transpose();
  gradient_[vertex] += weight * residual * gradient;
}

std::vector<Eigen::Vector3d> SurfaceOffset::solve(double smoothness, double stay) const {
  const auto n = static_cast<int>(hessian_.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right(3 * n);
  for (int v = 0; v < n; ++v) {
    right.segment<3>(3 * v) = -gradient_[v];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) entries.emplace_back(3 * v + i, 3 * v + j, hessian_[v](i, j) + (i == j ? stay : 0.0));
  }
  for (const auto& [a, b] : topology_.edges())
    for (int i = 0; i < 3; ++i) {
      entries.emplace_back(3 * a + i, 3 * a + i, smoothness);
      entries.emplace_back(3 * b + i, 3 * b + i, smoothness);
      entries.emplace_back(3 * a + i, 3 * b + i, -smoothness);
      entries.emplace_back(3 * b + i, 3 * a + i, -smoothness);
    }
  Eigen::SparseMatrix<double> matrix(3 * n, 3 * n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  Eigen::VectorXd found;
  if (solver.info() == Eigen::Success) found = solver.solve(right);
  if (solver.info() != Eigen::Success || !found.allFinite()) fail("the offsets of the surface cannot be solved for");
  std::vector<Eigen::Vector3d> offsets;
  for (int v = 0; v < n; ++v) offsets.emplace_back(found.segment<3>(3 * v));
  return offsets;
}

}  // namespace doppel
