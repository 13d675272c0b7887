#include "doppel/actor/export/correctives/convex_weights.h"

#include <algorithm>
#include <vector>

#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

using Support = std::vector<Eigen::Index>;

constexpr double kStop = 1e-9;  ///< relative to the least value: a point that lowers it by less does not enter

Eigen::MatrixXd part_of(const Eigen::MatrixXd& products, const Support& support) { return products(support, support); }

/// The best weights of sum 1 on a support, of any sign.
Eigen::VectorXd affine_weights(const Eigen::MatrixXd& products, const Support& support) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(support.size()));
  const Eigen::VectorXd found = solve_symmetric(part_of(products, support), ones);
  return found / found.sum();
}

/// Moves the weights of a support towards the affine ones, and leaves points out, until none is negative.
void settle(const Eigen::MatrixXd& products, Support& support, Eigen::VectorXd& weights) {
  for (;;) {
    const Eigen::VectorXd wanted = affine_weights(products, support);
    double step = 1.0;
    for (Eigen::Index i = 0; i < wanted.size(); ++i)
      if (wanted(i) <= 0.0)
        step = std::min(step, weights(support[static_cast<std::size_t>(i)]) /
                                  (weights(support[static_cast<std::size_t>(i)]) - wanted(i)));
    Support kept;
    for (Eigen::Index i = 0; i < wanted.size(); ++i) {
      const Eigen::Index point = support[static_cast<std::size_t>(i)];
      weights(point) += step * (wanted(i) - weights(point));
      if (step < 1.0 && wanted(i) <= 0.0 && weights(point) < 1e-12) weights(point) = 0.0;
      if (weights(point) > 0.0) kept.push_back(point);
    }
    if (kept.size() == support.size()) return;
    support = std::move(kept);
    weights /= weights.sum();
  }
}

}  // namespace

Eigen::VectorXd convex_weights(const Eigen::MatrixXd& products) {
  const Eigen::Index n = products.rows();
  Eigen::Index first = 0;
  products.diagonal().minCoeff(&first);
  Support support{first};
  Eigen::VectorXd weights = Eigen::VectorXd::Unit(n, first);
  for (Eigen::Index round = 0; round < 4 * n; ++round) {
    const Eigen::VectorXd inner = products * weights;
    Eigen::Index nearest = 0;
    if (inner.minCoeff(&nearest) >= (1.0 - kStop) * weights.dot(inner)) break;
    if (std::find(support.begin(), support.end(), nearest) != support.end()) break;
    support.push_back(nearest);
    settle(products, support, weights);
  }
  return weights;
}

Eigen::VectorXd sparse_convex_weights(const Eigen::MatrixXd& products, int count) {
  Eigen::VectorXd weights = convex_weights(products);
  for (;;) {
    Support support;
    for (Eigen::Index i = 0; i < weights.size(); ++i)
      if (weights(i) > 0.0) support.push_back(i);
    if (static_cast<int>(support.size()) <= count) return weights;
    support.erase(std::min_element(support.begin(), support.end(),
                                   [&](Eigen::Index a, Eigen::Index b) { return weights(a) < weights(b); }));
    const Eigen::VectorXd rest = convex_weights(part_of(products, support));
    weights.setZero();
    weights(support) = rest;
  }
}

}  // namespace doppel
