#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "doppel/solver/dense_system.h"
#include "doppel/solver/least_squares.h"

namespace doppel::solver_test {
namespace {

/// Two unknowns, rows given by a function: the published test problems below.
class SmallProblem : public LeastSquaresProblem {
 public:
  using Rows = std::function<void(const Eigen::VectorXd&, Residuals&)>;
  SmallProblem(int unknowns, Rows rows, RobustKernel kernel = {})
      : unknowns_(unknowns), rows_(std::move(rows)), kernel_(kernel) {}

  double cost(const Eigen::VectorXd& x) override { return evaluate(x, false); }
  double linearise(const Eigen::VectorXd& x) override {
    const double cost = evaluate(x, true);
    system_.reset(unknowns_);
    system_.add(residuals_);
    return cost;
  }
  bool solve(double damping, Eigen::VectorXd& step) override { return system_.solve(damping, step); }
  std::vector<TermCost> term_costs() const override { return {{"rows", last_}}; }

 private:
  double evaluate(const Eigen::VectorXd& x, bool jacobian) {
    residuals_.reset(unknowns_, 1, kernel_, jacobian);
    rows_(x, residuals_);
    return last_ = residuals_.cost();
  }
  int unknowns_;
  Rows rows_;
  RobustKernel kernel_;
  DenseSystem system_;
  Residuals residuals_;
  double last_ = 0.0;
};

void add_row(Residuals& rows, double value, const Eigen::RowVectorXd& jacobian, double weight = 1.0) {
  const Eigen::Index row = rows.add_group(weight);
  rows.value(row) = value;
  if (rows.has_jacobian()) rows.jacobian(row) = jacobian;
}

TEST(Solver, FindsRosenbrocksMinimum) {
  SmallProblem problem(2, [](const Eigen::VectorXd& x, Residuals& rows) {
    add_row(rows, 10.0 * (x[1] - x[0] * x[0]), Eigen::RowVector2d(-20.0 * x[0], 10.0));
    add_row(rows, 1.0 - x[0], Eigen::RowVector2d(-1.0, 0.0));
  });
  Eigen::VectorXd x = Eigen::Vector2d(-1.2, 1.0);
  SolverOptions options;
  options.iterations = 100;
  options.function_tolerance = 1e-12;
  const SolverSummary summary = minimise(problem, x, options);
  EXPECT_NEAR(x[0], 1.0, 1e-6);
  EXPECT_NEAR(x[1], 1.0, 1e-6);
  EXPECT_NEAR(summary.initial_cost, 24.2, 1e-9);
  EXPECT_LT(summary.final_cost, 1e-12);
  ASSERT_EQ(summary.terms.size(), 1u);
  EXPECT_EQ(summary.terms[0].cost, summary.final_cost);
  EXPECT_NE(summary.reason, ConvergenceReason::iteration_limit) << to_string(summary.reason);
}

TEST(Solver, LinearProblemsTakeOneUndampedStep) {
  SmallProblem problem(2, [](const Eigen::VectorXd& x, Residuals& rows) {
    add_row(rows, x[0] + x[1] - 3.0, Eigen::RowVector2d(1.0, 1.0));
    add_row(rows, x[0] - x[1] - 1.0, Eigen::RowVector2d(1.0, -1.0));
  });
  Eigen::VectorXd x = Eigen::Vector2d(100.0, -50.0);
  SolverOptions options;
  options.initial_damping = 0.0;
  options.iterations = 1;
  const SolverSummary summary = minimise(problem, x, options);
  EXPECT_EQ(summary.iterations, 1);
  EXPECT_NEAR(x[0], 2.0, 1e-12);
  EXPECT_NEAR(x[1], 1.0, 1e-12);
}

TEST(Solver, SaysWhyItStopped) {
  const auto line = [](double jacobian_sign) {
    return SmallProblem(1, [jacobian_sign](const Eigen::VectorXd& x, Residuals& rows) {
      add_row(rows, x[0] * x[0] + 1.0, Eigen::RowVectorXd::Constant(1, jacobian_sign * 2.0 * x[0]));
    });
  };
  SolverOptions options;
  Eigen::VectorXd x = Eigen::VectorXd::Constant(1, 2.0);
  SmallProblem right = line(1.0);
  options.iterations = 1;
  EXPECT_EQ(minimise(right, x, options).reason, ConvergenceReason::iteration_limit);
  options.iterations = 500;
  EXPECT_EQ(minimise(right, x, options).reason, ConvergenceReason::function_tolerance);
  x[0] = 2.0;
  SmallProblem wrong = line(-1.0);
  EXPECT_EQ(minimise(wrong, x, options).reason, ConvergenceReason::no_descent);
  EXPECT_EQ(x[0], 2.0);
  x[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(minimise(right, x, options).reason, ConvergenceReason::not_finite);
  SmallProblem near = line(1.0);
  x[0] = 1e-3;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 1.0;
  EXPECT_EQ(minimise(near, x, options).reason, ConvergenceReason::parameter_tolerance);
}

TEST(Solver, AnUnknownThatNothingDependsOnStays) {
  SmallProblem problem(
      2, [](const Eigen::VectorXd& x, Residuals& rows) { add_row(rows, x[0] - 1.0, Eigen::RowVector2d(1.0, 0.0)); });
  Eigen::VectorXd x = Eigen::Vector2d(5.0, 7.0);
  minimise(problem, x);
  EXPECT_NEAR(x[0], 1.0, 1e-6);
  EXPECT_EQ(x[1], 7.0);
}

/// Whatever the numbers of unknowns and rows, some of which depend on one unknown only.
TEST(Solver, NormalEquationsAreTheSumsOverWeightedRows) {
  const RobustKernel kernel{RobustKernel::Kind::geman_mcclure, 1.0};
  for (const int unknowns : {1, 7, 8, 33, 107})
    for (const int groups : {1, 40, 97}) {
      Residuals rows;
      rows.reset(unknowns, 2, kernel, true);
      Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(unknowns, unknowns);
      Eigen::VectorXd gradient = Eigen::VectorXd::Zero(unknowns);
      for (int group = 0; group < groups; ++group) {
        const Eigen::Index first = rows.add_group(1.0 + group % 3);
        for (int i = 0; i < 2; ++i) {
          rows.value(first + i) = std::sin(3.0 * group + i);
          for (int u = 0; u < unknowns; ++u)
            rows.jacobian(first + i)[u] =
                group % 4 == 3 && u != group % unknowns ? 0.0 : std::cos(group + 5.0 * i + 7.0 * u);
        }
        for (int i = 0; i < 2; ++i) {
          const Eigen::RowVectorXd jacobian = rows.factor(group) * rows.jacobian(first + i);
          hessian += jacobian.transpose() * jacobian;
          gradient += jacobian.transpose() * rows.factor(group) * rows.value(first + i);
        }
      }
      DenseSystem system;
      system.reset(unknowns);
      system.add(rows);
      const Eigen::VectorXd probe = Eigen::VectorXd::LinSpaced(unknowns, -1.0, 2.0);
      EXPECT_LT((system.product(probe) - hessian * probe).norm(), 1e-12 * (1.0 + hessian.norm() * probe.norm()));
      EXPECT_LT((system.gradient() - gradient).norm(), 1e-12 * (1.0 + gradient.norm() + groups));
    }
}

TEST(Solver, RobustKernelsForgetGrossOutliers) {
  const auto mean_of = [](RobustKernel kernel) {
    SmallProblem problem(
        1,
        [](const Eigen::VectorXd& x, Residuals& rows) {
          for (const double value : {0.9, 1.0, 1.1, 30.0})
            add_row(rows, x[0] - value, Eigen::RowVectorXd::Constant(1, 1.0));
        },
        kernel);
    Eigen::VectorXd x = Eigen::VectorXd::Constant(1, 0.0);
    SolverOptions options;
    options.iterations = 200;
    options.function_tolerance = 1e-12;
    minimise(problem, x, options);
    return x[0];
  };
  EXPECT_NEAR(mean_of({}), 33.0 / 4.0, 1e-6);
  // Balance: three residuals of x - 1 against the pull of the kernel's scale.
  EXPECT_NEAR(mean_of({RobustKernel::Kind::huber, 0.5}), 1.0 + 0.5 / 3.0, 1e-6);
  EXPECT_NEAR(mean_of({RobustKernel::Kind::geman_mcclure, 0.5}), 1.0, 1e-3);
}

TEST(Solver, KernelsWeightsAreTheirJacobian) {
  for (const auto kind : {RobustKernel::Kind::none, RobustKernel::Kind::huber, RobustKernel::Kind::geman_mcclure}) {
    const RobustKernel kernel{kind, 1.3};
    for (const double s : {0.0, 0.4, 1.5, 2.0, 90.0}) {
      const double step = 1e-6, low = std::max(0.0, s - step);
      EXPECT_NEAR(kernel.weight(s), (kernel.cost(s + step) - kernel.cost(low)) / (s + step - low), 1e-5);
    }
  }
}

}  // namespace
}  // namespace doppel::solver_test
