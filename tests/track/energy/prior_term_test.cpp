#include "doppel/track/energy/terms/prior_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::prior_term_test {
namespace {

TEST(PriorTerm, HoldsWhatNothingSpeaksForAndLeavesTheRootFree) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  PriorTerm term("prior", character.rest_dofs, 3.0);
  const std::vector<double> dofs = bent_pose(character, 0.2);
  Residuals rows;
  term.evaluate(model, model.pose(dofs, true), true, rows);
  ASSERT_EQ(rows.num_rows(), character.num_dofs() - 6);
  EXPECT_NEAR(rows.value(0), std::hypot(0.6, 0.4) * (dofs[6] - character.rest_dofs[6]), 1e-12);
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row)
    for (int u = 0; u < 6; ++u) EXPECT_EQ(rows.jacobian(row)[u < 3 ? u : model.num_unknowns() - u + 2], 0.0);
  support::check_term(term, model, dofs);
  support::check_energy_gradient(term, model, dofs);
  support::check_weight([&](double weight) { return PriorTerm("prior", character.rest_dofs, weight); }, model, dofs);
}

TEST(PriorTerm, WeighsEachDofAsItIsTold) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  const PosedBody body = model.pose(bent_pose(character, 0.2), false);
  const auto cost = [&](double others, double sixth) {  // the sixth is the first that does not move the root
    std::vector<double> weights(character.rest_dofs.size(), others);
    weights[6] = sixth;
    Residuals rows;
    PriorTerm("prior", character.rest_dofs, weights).evaluate(model, body, false, rows);
    return rows.cost();
  };
  Residuals even;
  PriorTerm("prior", character.rest_dofs, 2.0).evaluate(model, body, false, even);
  EXPECT_NEAR(cost(2.0, 2.0), even.cost(), 1e-12);
  EXPECT_GT(cost(0.0, 2.0), 0.0);
  EXPECT_NEAR(cost(2.0, 8.0), even.cost() + 3.0 * cost(0.0, 2.0), 1e-9);
}

}  // namespace
}  // namespace doppel::prior_term_test
