#include "doppel/solver/schur_system.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <limits>
#include <random>

#include "doppel/solver/dense_system.h"

namespace doppel {
namespace {

/// The same random rows for a SchurSystem and as dense equations.
struct Problem {
  SchurSystem system;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

Problem random_problem(int shared, const std::vector<int>& sizes) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, 1.0);
  Problem problem;
  problem.system.reset(shared, sizes);
  int unknowns = shared;
  for (const int size : sizes) unknowns += size;
  problem.hessian.setZero(unknowns, unknowns);
  problem.gradient.setZero(unknowns);
  int begin = shared;
  for (std::size_t g = 0; g < sizes.size(); ++g) {
    for (int row = 0; row < 4 * sizes[g]; ++row) {
      Eigen::VectorXd jacobian = Eigen::VectorXd::Zero(unknowns);
      for (int i = 0; i < shared; ++i) jacobian[i] = normal(random);
      for (int i = 0; i < sizes[g]; ++i) jacobian[begin + i] = normal(random);
      const double value = normal(random);
      problem.hessian += jacobian * jacobian.transpose();
      problem.gradient += jacobian * value;
      const Eigen::VectorXd own = jacobian.segment(begin, sizes[g]), common = jacobian.head(shared);
      SchurSystem::Group& group = problem.system.group(g);
      group.hessian += own * own.transpose();
      group.cross += own * common.transpose();
      group.gradient += own * value;
      problem.system.hessian() += common * common.transpose();
      problem.system.gradient() += common * value;
    }
    begin += sizes[g];
  }
  return problem;
}

TEST(SchurSystem, StepIsThatOfTheWholeSystem) {
  const Problem problem = random_problem(7, {3, 6, 3, 9});
  for (const double damping : {0.0, 1e-3, 2.0}) {
    Eigen::MatrixXd damped = problem.hessian;
    damped.diagonal() *= 1.0 + damping;
    Eigen::VectorXd step;
    ASSERT_TRUE(problem.system.solve(damping, step));
    EXPECT_LT((step - damped.llt().solve(-problem.gradient)).norm(), 1e-9);
  }
}

TEST(SchurSystem, ReducedHessianIsTheInverseOfTheSharedCovariance) {
  const Problem problem = random_problem(5, {3, 3, 6});
  const Eigen::MatrixXd inverse = problem.hessian.inverse();
  const Eigen::MatrixXd reduced = problem.system.reduced_hessian();
  EXPECT_LT((reduced.inverse() - inverse.topLeftCorner(5, 5)).norm(), 1e-6 * inverse.norm());
  Problem copy = problem;
  Eigen::VectorXd gradient = copy.system.gradient();
  for (const Eigen::VectorXd& part : problem.system.reduced_gradients()) gradient += part;
  Eigen::VectorXd step;
  ASSERT_TRUE(problem.system.solve(0.0, step));
  EXPECT_LT((reduced * step.head(5) + gradient).norm(), 1e-5);
}

TEST(SchurSystem, UnknownsWithoutRowsKeepTheirValues) {
  SchurSystem system;
  system.reset(2, {3});
  system.hessian()(0, 0) = 4.0;
  system.gradient()[0] = 2.0;
  Eigen::VectorXd step;
  ASSERT_TRUE(system.solve(0.0, step));
  EXPECT_EQ(step, (Eigen::VectorXd(5) << -0.5, 0, 0, 0, 0).finished());
  system.hessian()(0, 0) = -1.0;
  system.group(0).hessian(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(system.solve(0.0, step));
}

}  // namespace
}  // namespace doppel
