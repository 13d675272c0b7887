#include "doppel/track/energy/terms/limit_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::limit_term_test {
namespace {

TEST(LimitTerm, IsABarrierOutsideOfTheLimitsOnly) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  LimitTerm term(5.0);
  Residuals rows;
  std::vector<double> dofs(character.rest_dofs.size(), 0.0);
  term.evaluate(model, model.pose(dofs, true), true, rows);
  EXPECT_EQ(rows.num_rows(), 0);

  const int bend = *character.skeleton.find_dof("bend"), lean = *character.skeleton.find_dof("lean_2");
  dofs[bend] = 1.5;   // limits -1.2 .. 1.2, on joints with the weights 0.6 and -0.4
  dofs[lean] = -1.0;  // limits -0.8 .. 0.9
  term.evaluate(model, model.pose(dofs, true), true, rows);
  ASSERT_EQ(rows.num_rows(), 2);
  EXPECT_NEAR(rows.value(0), 0.3 * std::hypot(0.6, 0.4), 1e-12);
  EXPECT_NEAR(rows.value(1), -0.2, 1e-12);
  EXPECT_NEAR(rows.cost(), 5.0 * (std::pow(0.3 * std::hypot(0.6, 0.4), 2) + 0.04), 1e-12);
  support::check_term(term, model, dofs);
  support::check_energy_gradient(term, model, dofs);
  support::check_weight([](double weight) { return LimitTerm(weight); }, model, dofs);
}

}  // namespace
}  // namespace doppel::limit_term_test
