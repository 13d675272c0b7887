#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "doppel/track/terms/term.h"

namespace doppel::support {

/// Holds a term's slopes at `dofs` to central differences of its rows in double, unknown by unknown; a mismatch is
/// reported with the unknown's name and the row. Also that every row depends on something, and that the energy is half
/// the slope's worth: d cost = 2 sum w k' r dr.
inline void check_term(PoseTerm& term, const PoseModel& model, const std::vector<double>& dofs,
                       double tolerance = 1e-6) {
  const PosedBody body = model.pose(dofs, true);
  term.freeze(model, body);
  Residuals rows;
  term.evaluate(model, body, true, rows);
  ASSERT_GT(rows.num_rows(), 0) << term.name() << " has no rows here";
  constexpr double kStep = 1e-6;
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const auto at = [&](double step) {
      Residuals moved;
      const Eigen::VectorXd change = step * Eigen::VectorXd::Unit(model.num_unknowns(), u);
      term.evaluate(model, model.pose(model.moved(dofs, change), false), false, moved);
      EXPECT_EQ(moved.num_rows(), rows.num_rows());
      return moved;
    };
    const Residuals more = at(kStep), less = at(-kStep);
    for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
      const double numeric = (more.value(row) - less.value(row)) / (2.0 * kStep), analytic = rows.slope(row)[u];
      ASSERT_NEAR(analytic, numeric, tolerance * std::max(1.0, std::abs(numeric)))
          << term.name() << ": row " << row << " by " << model.unknown_name(u);
    }
  }
}

/// The gradient of the whole energy, robust kernel included, against central differences of its cost.
inline void check_energy_gradient(PoseTerm& term, const PoseModel& model, const std::vector<double>& dofs,
                                  double tolerance = 1e-5) {
  const PosedBody body = model.pose(dofs, true);
  term.freeze(model, body);
  Residuals rows;
  term.evaluate(model, body, true, rows);
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(model.num_unknowns(), model.num_unknowns());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(model.num_unknowns());
  rows.add_to(hessian, gradient);
  const double largest = gradient.cwiseAbs().maxCoeff();
  ASSERT_GT(largest, 0.0);
  constexpr double kStep = 1e-6;
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const auto cost = [&](double step) {
      Residuals moved;
      const Eigen::VectorXd change = step * Eigen::VectorXd::Unit(model.num_unknowns(), u);
      term.evaluate(model, model.pose(model.moved(dofs, change), false), false, moved);
      return moved.cost();
    };
    EXPECT_NEAR(2.0 * gradient[u], (cost(kStep) - cost(-kStep)) / (2.0 * kStep), tolerance * largest)
        << term.name() << " by " << model.unknown_name(u);
  }
}

/// The energy and its normal equations are proportional to the weight.
template <typename MakeTerm>
void check_weight(const MakeTerm& make_term, const PoseModel& model, const std::vector<double>& dofs) {
  const PosedBody body = model.pose(dofs, true);
  const auto at = [&](double weight) {
    auto term = make_term(weight);
    term.freeze(model, body);
    Residuals rows;
    term.evaluate(model, body, true, rows);
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(model.num_unknowns(), model.num_unknowns());
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(model.num_unknowns());
    const double cost = rows.cost();
    rows.add_to(hessian, gradient);
    return std::tuple(cost, hessian, gradient);
  };
  const auto [cost, hessian, gradient] = at(1.0);
  const auto [cost3, hessian3, gradient3] = at(3.0);
  EXPECT_GT(cost, 0.0);
  EXPECT_NEAR(cost3, 3.0 * cost, 1e-9 * cost);
  EXPECT_LT((hessian3 - 3.0 * hessian).cwiseAbs().maxCoeff(), 1e-9 * hessian.cwiseAbs().maxCoeff());
  EXPECT_LT((gradient3 - 3.0 * gradient).cwiseAbs().maxCoeff(), 1e-9 * gradient.cwiseAbs().maxCoeff());
}

}  // namespace doppel::support
