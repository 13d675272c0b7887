#include "doppel/geometry/decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace doppel {

Svd3 svd(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {parts.matrixU(), parts.singularValues(), parts.matrixV()};
}

SymmetricEigen3 symmetric_eigen(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::Vector3d solve_symmetric(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& right) {
  return matrix.ldlt().solve(right);
}

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  return matrix.ldlt().solve(right);
}

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

std::optional<Eigen::VectorXd> solve_positive_definite(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  const Eigen::LLT<Eigen::MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return Eigen::VectorXd(factor.solve(right));
}

std::optional<Eigen::MatrixXd> solve_positive_definite(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  const Eigen::LLT<Eigen::MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return Eigen::MatrixXd(factor.solve(right));
}

}  // namespace doppel
