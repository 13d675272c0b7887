#include "doppel/track/energy/terms/gaussian_term.h"

#include <Eigen/Cholesky>

#include "support/message_of.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::gaussian_term_test {
namespace {

struct Setting {
  Character character = make_test_character(4);
  PoseModel model{character, tube_landmarks(4), all_dofs(character)};
  std::vector<double> mean = bent_pose(character, 0.1), dofs = bent_pose(character, 0.3, 0.9);

  /// Positive definite, with correlations.
  Eigen::MatrixXd covariance() const {
    const Eigen::Index n = model.num_unknowns();
    Eigen::MatrixXd root(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j) root(i, j) = std::sin(1.0 + 3.1 * i + 1.7 * j);
    return root * root.transpose() + Eigen::MatrixXd::Identity(n, n);
  }
};

TEST(GaussianTerm, IsTheSquaredMahalanobisDistance) {
  const Setting s;
  Residuals rows;
  GaussianTerm("motion", s.mean, s.covariance()).evaluate(s.model, s.model.pose(s.dofs, false), false, rows);
  const Eigen::VectorXd step = s.model.step_between(s.mean, s.dofs);
  EXPECT_NEAR(rows.cost(), step.dot(s.covariance().ldlt().solve(step)), 1e-9 * rows.cost());
  GaussianTerm("motion", s.dofs, s.covariance()).evaluate(s.model, s.model.pose(s.dofs, false), false, rows);
  EXPECT_NEAR(rows.cost(), 0.0, 1e-20);
}

TEST(GaussianTerm, Jacobian) {
  const Setting s;
  GaussianTerm term("motion", s.mean, s.covariance());
  support::check_term(term, s.model, s.dofs);
  support::check_energy_gradient(term, s.model, s.dofs);
  support::check_term(term, s.model, s.mean);  // where the turn is zero
}

TEST(GaussianTerm, RejectsACovarianceThatIsNone) {
  const Setting s;
  Eigen::MatrixXd covariance = s.covariance();
  covariance(0, 0) = -1.0;
  EXPECT_NE(support::message_of([&] { GaussianTerm("motion", s.mean, covariance); }).find("not positive definite"),
            std::string::npos);
}

TEST(PoseModel, StepBetweenUndoesMoved) {
  const Setting s;
  const Eigen::VectorXd step = Eigen::VectorXd::LinSpaced(s.model.num_unknowns(), -0.4, 0.5);
  EXPECT_LT((s.model.step_between(s.dofs, s.model.moved(s.dofs, step)) - step).cwiseAbs().maxCoeff(), 1e-9);
}

}  // namespace
}  // namespace doppel::gaussian_term_test
