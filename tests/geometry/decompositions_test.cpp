#include "doppel/geometry/decompositions.h"

#include <gtest/gtest.h>

#include "doppel/geometry/best_rotation.h"

namespace doppel::decompositions_test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const Matrix3d kMatrix = (Matrix3d() << 2, -1, 0.5, 0.3, 4, 1, -2, 0.1, 3).finished();
const Matrix3d kSymmetric = kMatrix * kMatrix.transpose();

TEST(Decompositions, ProductsOfTheirPartsAreTheMatrix) {
  const auto [U, values, V] = svd(kMatrix);
  EXPECT_TRUE((U * values.asDiagonal() * V.transpose()).isApprox(kMatrix, 1e-12));
  EXPECT_GE(values[0], values[1]);
  EXPECT_GE(values[1], values[2]);
  const auto [rising, vectors] = symmetric_eigen(kSymmetric);
  EXPECT_TRUE((vectors * rising.asDiagonal() * vectors.transpose()).isApprox(kSymmetric, 1e-12));
  EXPECT_LE(rising[0], rising[1]);
  EXPECT_LE(rising[1], rising[2]);
}

TEST(Decompositions, SolutionsSolve) {
  const Vector3d right(1, -2, 3);
  EXPECT_TRUE((kSymmetric * solve_symmetric(kSymmetric, right)).isApprox(right, 1e-12));
  const MatrixXd matrix = kSymmetric;
  const VectorXd vector = right;
  const MatrixXd unit = MatrixXd::Identity(3, 3);
  EXPECT_TRUE((matrix * solve_symmetric(matrix, vector)).isApprox(vector, 1e-12));
  EXPECT_TRUE((matrix * solve_symmetric(matrix, unit)).isApprox(unit, 1e-12));
  EXPECT_TRUE((matrix * solve_positive_definite(matrix, vector).value()).isApprox(vector, 1e-12));
  EXPECT_TRUE((matrix * solve_positive_definite(matrix, unit).value()).isApprox(unit, 1e-12));
  EXPECT_FALSE(solve_positive_definite(-matrix, vector));
}

TEST(BestRotation, BetweenTwoDirections) {
  const Vector3d from(1, 2, -1), to(0.3, -4, 2);
  EXPECT_TRUE((rotation_between(from, to) * from.normalized()).isApprox(to.normalized(), 1e-12));
  EXPECT_TRUE((rotation_between(from, -from) * from).isApprox(-from, 1e-9));
}

TEST(BestRotation, NearestToAMatrixThatMirrorsDoesNotMirror) {
  const Matrix3d mirror = Vector3d(1, 2, -0.5).asDiagonal();
  EXPECT_TRUE(nearest_rotation(mirror).isApprox(Matrix3d::Identity(), 1e-12));
}

}  // namespace
}  // namespace doppel::decompositions_test
