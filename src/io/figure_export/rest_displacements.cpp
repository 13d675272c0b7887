#include "doppel/io/figure_export/rest_displacements.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

/// Damping of the inverse of a blended matrix, which is nearly singular where a limb is twisted by half a turn.
constexpr double kInverseDamping = 1e-3;
/// Components below this share of the largest are noise.
constexpr double kMinShare = 1e-9;

/// Orthonormal components of columns from which their mean was subtracted, largest first. @return [3N, K]
Eigen::MatrixXf principal_components(const Eigen::MatrixXf& columns, int count) {
  // By the eigenvectors of their inner products. In single precision, small components would not be orthogonal.
  const Eigen::MatrixXd exact = columns.cast<double>(), gram = exact.transpose() * exact;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  const Eigen::Index last = gram.rows() - 1;
  const double largest = std::max(solver.eigenvalues()(last), 0.0);
  int used = 0;
  while (used < count && used <= last && solver.eigenvalues()(last - used) > std::max(largest * kMinShare, 1e-12))
    ++used;
  Eigen::MatrixXf components(exact.rows(), used);
  for (int k = 0; k < used; ++k)
    components.col(k) = (exact * solver.eigenvectors().col(last - k)).normalized().cast<float>();
  return components;
}

}  // namespace

Eigen::VectorXf unposed_displacements(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                                      std::span<const float> vertices) {
  Eigen::VectorXf result(3 * static_cast<Eigen::Index>(blended.size()));
  for (std::size_t v = 0; v < blended.size(); ++v) {
    const Eigen::Matrix3d M = blended[v].linear();
    const Eigen::Vector3d vertex = Eigen::Map<const Eigen::Vector3f>(&vertices[3 * v]).cast<double>();
    const Eigen::Matrix3d normal = M.transpose() * M + kInverseDamping * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d right = M.transpose() * (vertex - blended[v] * figure.rest_vertices[v]);
    result.segment<3>(3 * static_cast<Eigen::Index>(v)) = solve_symmetric(normal, right).cast<float>();
  }
  return result;
}

LinearShapes linear_shapes(Eigen::MatrixXf displacements, int count) {
  LinearShapes shapes;
  shapes.mean = displacements.rowwise().mean();
  displacements.colwise() -= shapes.mean;
  shapes.components = principal_components(displacements, count);
  return shapes;
}

Eigen::MatrixX3f target_rows(const Eigen::VectorXf& displacements) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(displacements.data(), displacements.size() / 3, 3);
}

}  // namespace doppel
