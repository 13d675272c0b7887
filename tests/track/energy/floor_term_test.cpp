#include "doppel/track/energy/terms/floor_term.h"

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::floor_term_test {
namespace {

struct Setting {
  Character character = make_test_character(4);
  PoseModel model{character, tube_landmarks(4), all_dofs(character)};
  std::vector<double> dofs = bent_pose(character, 0.2);
  Eigen::Vector3d position = model.landmark(model.pose(dofs, false), 1);

  double cost(const FloorTerm& term) const {
    Residuals rows;
    term.evaluate(model, model.pose(dofs, false), false, rows);
    return rows.cost();
  }
};

TEST(FloorTerm, CountsHeightAndSliding) {
  const Setting s;
  const Eigen::Vector3d last = s.position - Eigen::Vector3d(0.03, 0.5, -0.04);
  EXPECT_NEAR(s.cost(FloorTerm({{1, s.position.y() - 0.02, last}}, 3.0, 0.25, {})),
              3.0 * (0.02 * 0.02 + 0.25 * 0.05 * 0.05), 1e-12);
  EXPECT_NEAR(s.cost(FloorTerm({{1, s.position.y(), s.position}}, 3.0, 0.25, {})), 0.0, 1e-20);
  EXPECT_NEAR(s.cost(FloorTerm({{1, s.position.y(), last}}, 3.0, 0.0, {})), 0.0, 1e-20) << "without sliding";
}

TEST(FloorTerm, ALiftedFootHasLittleInfluence) {
  const Setting s;
  const auto kernel = RobustKernel::geman_mcclure_of(0.02);
  const auto pull = [&](double lifted) {
    FloorTerm term({{1, s.position.y() - lifted, s.position}}, 1.0, 0.2, kernel);
    return support::system_of(term, s.model, s.dofs).gradient().norm();
  };
  EXPECT_LT(pull(0.2), 0.01 * pull(0.01));
}

TEST(FloorTerm, JacobianAndWeight) {
  const Setting s;
  const std::vector<FloorTerm::Sole> soles{{1, s.position.y() - 0.01, s.position - Eigen::Vector3d(0.01, 0.0, 0.02)},
                                           {4, 0.1, Eigen::Vector3d(0.2, 0.1, 0.3)}};
  FloorTerm term(soles, 2.0, 0.3, RobustKernel::geman_mcclure_of(0.02));
  support::check_term(term, s.model, s.dofs);
  support::check_energy_gradient(term, s.model, s.dofs);
  support::check_weight([&](double weight) { return FloorTerm(soles, weight, 0.3, {}); }, s.model, s.dofs);
}

}  // namespace
}  // namespace doppel::floor_term_test
