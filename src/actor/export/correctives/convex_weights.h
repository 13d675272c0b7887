#pragma once

#include <Eigen/Core>

namespace doppel {

/// The weights w with the least w^T E w among those that are not negative and have the sum 1: the point nearest to the
/// origin in the hull of points whose inner products are E (P. Wolfe, "Finding the nearest point in a polytope", 1976).
/// For skinning the points are what single joints leave of a vertex.
/// @param products E [n, n], symmetric and positive definite, n > 0
Eigen::VectorXd convex_weights(const Eigen::MatrixXd& products);

/// The same with at most `count` weights that are not 0: the smallest are removed one by one, and the others found
/// anew.
Eigen::VectorXd sparse_convex_weights(const Eigen::MatrixXd& products, int count);

}  // namespace doppel
