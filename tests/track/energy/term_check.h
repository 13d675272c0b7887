#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "doppel/track/energy/terms/term.h"

namespace doppel::support {

/// The rows of a term, frozen at `state` and worked out there with jacobian.
template <typename Model>
typename Model::Rows frozen_rows(Term<Model>& term, const Model& model, const std::vector<double>& state) {
  const auto posed = model.pose(state, true);
  typename Model::Rows rows;
  term.linearise(model, posed, rows);
  return rows;
}

/// The rows a step of one unknown away, under the same freeze.
template <typename Model>
typename Model::Rows rows_after(const Term<Model>& term, const Model& model, const std::vector<double>& state,
                                int unknown, double step) {
  typename Model::Rows rows;
  const Eigen::VectorXd change = step * Eigen::VectorXd::Unit(model.num_unknowns(), unknown);
  term.evaluate(model, model.pose(model.moved(state, change), false), false, rows);
  return rows;
}

/// Holds a term's jacobian at `state` to central differences of its rows in double, unknown by unknown; a mismatch is
/// reported with the unknown's name and the row.
template <typename Model>
void check_term(Term<Model>& term, const Model& model, const std::vector<double>& state, double tolerance = 1e-6) {
  typename Model::Rows rows = frozen_rows(term, model, state);
  ASSERT_GT(rows.num_rows(), 0) << term.name() << " has no rows here";
  constexpr double kStep = 1e-6;
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const auto more = rows_after(term, model, state, u, kStep), less = rows_after(term, model, state, u, -kStep);
    ASSERT_EQ(more.num_rows(), rows.num_rows());
    for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
      const double numeric = (more.value(row) - less.value(row)) / (2.0 * kStep), analytic = rows.jacobian(row)[u];
      ASSERT_NEAR(analytic, numeric, tolerance * std::max(1.0, std::abs(numeric)))
          << term.name() << ": row " << row << " by " << model.unknown_name(u);
    }
  }
}

/// The normal equations of one term.
template <typename Model>
typename Model::System system_of(Term<Model>& term, const Model& model, const std::vector<double>& state) {
  auto rows = frozen_rows(term, model, state);
  typename Model::System system;
  system.reset(model.num_unknowns());
  system.add(rows);
  return system;
}

/// The gradient of the whole energy, robust kernel included, against central differences of its cost.
template <typename Model>
void check_energy_gradient(Term<Model>& term, const Model& model, const std::vector<double>& state,
                           double tolerance = 1e-5) {
  const Eigen::VectorXd gradient = system_of(term, model, state).gradient();
  const double largest = gradient.cwiseAbs().maxCoeff();
  ASSERT_GT(largest, 0.0);
  constexpr double kStep = 1e-6;
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const double more = rows_after(term, model, state, u, kStep).cost();
    const double less = rows_after(term, model, state, u, -kStep).cost();
    EXPECT_NEAR(2.0 * gradient[u], (more - less) / (2.0 * kStep), tolerance * largest)
        << term.name() << " by " << model.unknown_name(u);
  }
}

/// The energy and its normal equations are proportional to the weight.
template <typename Model, typename MakeTerm>
void check_weight(const MakeTerm& make_term, const Model& model, const std::vector<double>& state) {
  const Eigen::VectorXd probe = Eigen::VectorXd::LinSpaced(model.num_unknowns(), -1.0, 2.0);
  const auto at = [&](double weight) {
    auto term = make_term(weight);
    const double cost = frozen_rows<Model>(term, model, state).cost();
    const auto system = system_of<Model>(term, model, state);
    return std::tuple(cost, Eigen::VectorXd(system.product(probe)), Eigen::VectorXd(system.gradient()));
  };
  const auto [cost, product, gradient] = at(1.0);
  const auto [cost3, product3, gradient3] = at(3.0);
  EXPECT_GT(cost, 0.0);
  EXPECT_NEAR(cost3, 3.0 * cost, 1e-9 * cost);
  EXPECT_LT((product3 - 3.0 * product).cwiseAbs().maxCoeff(), 1e-9 * product.cwiseAbs().maxCoeff());
  EXPECT_LT((gradient3 - 3.0 * gradient).cwiseAbs().maxCoeff(), 1e-9 * gradient.cwiseAbs().maxCoeff());
}

}  // namespace doppel::support
