#include "doppel/track/surface/surface_problem.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "doppel/track/surface/edge_weights.h"
#include "doppel/track/surface/length_term.h"
#include "doppel/track/surface/smoothness_term.h"
#include "doppel/track/surface/target_term.h"
#include "track/surface/surface_check.h"

namespace doppel::surface_problem_test {
namespace {

/// A shaken patch that is pulled back to the rest pose by edges and to other positions by its vertices.
struct Pull {
  explicit Pull(int side) : mesh(support::bumpy_patch(side)), topology(mesh) {
    for (const auto& [a, b] : topology.edges()) lengths.push_back((rest.col(a) - rest.col(b)).norm());
  }
  TriangleMesh mesh;
  MeshTopology topology;
  Eigen::Matrix3Xd rest = support::columns(mesh.vertices), targets = support::shaken(rest, 0.02);
  std::vector<double> weights = edge_weights(topology, std::vector<double>(mesh.vertices.size(), 1.5)), lengths;
  SmoothnessTerm smoothness{rest, topology.edges(), weights, 10.0};
  LengthTerm length{topology.edges(), weights, lengths, 30.0};
  TargetTerm pull{"pull", targets, 4.0};
  Eigen::VectorXd state = Eigen::Map<const Eigen::VectorXd>(rest.data(), rest.size());

  SurfaceProblem problem(int iterations) {
    SurfaceProblem result(mesh.num_vertices(), topology.edges(), iterations);
    result.set_terms({&smoothness, &length, &pull});
    return result;
  }
};

TEST(PointSystem, SolvesWhatTheDenseMatrixSays) {
  Pull pull(4);
  SurfaceProblem problem = pull.problem(200);
  problem.linearise(pull.state);
  const PointSystem& system = problem.system();
  Eigen::VectorXd step;
  ASSERT_TRUE(problem.solve(0.1, step));
  const Eigen::Index n = pull.state.size();
  Eigen::MatrixXd matrix(n, n);
  Eigen::VectorXd image;
  for (Eigen::Index i = 0; i < n; ++i) {
    system.multiply(Eigen::VectorXd::Unit(n, i), image);
    matrix.col(i) = image;
  }
  EXPECT_TRUE(matrix.isApprox(matrix.transpose(), 1e-12));
  const Eigen::VectorXd exact = matrix.ldlt().solve(-system.gradient());
  EXPECT_LT((step - exact).norm(), 1e-8 * exact.norm());
  // The diagonal without damping, and the gradient, from the rows themselves.
  problem.solve(0.0, step);
  system.multiply(Eigen::VectorXd::Unit(n, 4), image);
  EXPECT_NEAR(matrix(4, 4), 1.1 * image[4], 1e-9 * image[4]);
}

TEST(PointSystem, GradientIsThatOfTheCost) {
  Pull pull(4);
  SurfaceProblem problem = pull.problem(4);
  const Eigen::VectorXd at = pull.state + 0.003 * Eigen::VectorXd::LinSpaced(pull.state.size(), -1.0, 1.0);
  problem.linearise(at);
  const Eigen::VectorXd gradient = problem.system().gradient();
  constexpr double kStep = 1e-6;
  for (Eigen::Index i = 0; i < at.size(); ++i) {
    const Eigen::VectorXd change = kStep * Eigen::VectorXd::Unit(at.size(), i);
    const double numeric = (problem.cost(at + change) - problem.cost(at - change)) / (2.0 * kStep);
    EXPECT_NEAR(2.0 * gradient[i], numeric, 1e-6) << "vertex " << i / 3 << " along "
                                                  << "xyz"[i % 3];
  }
}

TEST(PointSystem, FewIterationsLeadDownhill) {
  Pull pull(9);
  for (const int iterations : {1, 2, 4}) {
    SurfaceProblem problem = pull.problem(iterations);
    const double before = problem.linearise(pull.state);
    Eigen::VectorXd step;
    ASSERT_TRUE(problem.solve(1e-6, step));
    EXPECT_LT(problem.cost(pull.state + step), before) << iterations;
  }
}

TEST(PointSystem, APointThatNothingHoldsStays) {
  PointSystem system(3, {{0, 1}});
  PointRows rows;
  rows.count = 1;
  rows.values[0] = 1.0;
  rows.jacobian.row(0) = Eigen::RowVector3d(1.0, 0.0, 0.0);
  system.add_at_point(0, rows);
  Eigen::VectorXd step;
  ASSERT_TRUE(system.solve(0.0, 10, step));
  EXPECT_NEAR(step[0], -1.0, 1e-6);
  EXPECT_TRUE(step.tail(8).isZero());
}

TEST(SurfaceProblem, FindsTheMinimumOfASumOfSquares) {
  Pull pull(6);
  SurfaceProblem problem(pull.mesh.num_vertices(), pull.topology.edges(), 50);
  TargetTerm only("only", pull.targets, 2.0);
  problem.set_terms({&only});
  Eigen::VectorXd state = pull.state;
  const SolverSummary summary = minimise(problem, state);
  EXPECT_NEAR(summary.final_cost, 0.0, 1e-12);
  ASSERT_EQ(summary.terms.size(), 1u);
  EXPECT_EQ(summary.terms[0].name, "only");
}

TEST(SurfaceProblem, HasTheSameBitsWithAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  Pull pull(60);
  const auto solution = [&](int threads) {
    at::set_num_threads(threads);
    SurfaceProblem problem = pull.problem(4);
    SolverOptions options;
    options.iterations = 3;
    Eigen::VectorXd state = pull.state;
    minimise(problem, state, options);
    return state;
  };
  const Eigen::VectorXd one = solution(1), two = solution(2), five = solution(5);
  at::set_num_threads(before);
  EXPECT_GT((one - pull.state).norm(), 1e-3);
  EXPECT_TRUE(one == two);
  EXPECT_TRUE(one == five);
}

}  // namespace
}  // namespace doppel::surface_problem_test
