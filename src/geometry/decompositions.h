#pragma once

#include <Eigen/Core>
#include <optional>

namespace doppel {

// Eigen's decompositions, instantiated in one source: each costs every source that instantiates it seconds of the
// build.

/// M = U diag(values) V^T. The values fall and are not negative.
struct Svd3 {
  Eigen::Matrix3d U;
  Eigen::Vector3d values;
  Eigen::Matrix3d V;
};
Svd3 svd(const Eigen::Matrix3d& matrix);

/// A symmetric matrix M = Q diag(values) Q^T. The values rise; the columns of Q are the eigenvectors.
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};
SymmetricEigen3 symmetric_eigen(const Eigen::Matrix3d& matrix);

/// X of M X = right, for a symmetric matrix that is not indefinite (LDLT). Not finite where M has no inverse.
/// @param matrix [n, n] @param right [n] or [n, m]
Eigen::Vector3d solve_symmetric(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& right);
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// X of M X = right, for a symmetric positive definite matrix (Cholesky); nothing when M is not.
/// @param matrix [n, n], of which the lower half is read @param right [n] or [n, m]
std::optional<Eigen::VectorXd> solve_positive_definite(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
std::optional<Eigen::MatrixXd> solve_positive_definite(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

}  // namespace doppel
