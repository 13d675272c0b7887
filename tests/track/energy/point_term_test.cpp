#include "doppel/track/energy/terms/point_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::point_term_test {
namespace {

TEST(PointTerm, MeasuresLandmarksInMetres) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  const std::vector<double> dofs = bent_pose(character, 0.2);
  const Eigen::Vector3d offset(0.1, -0.2, 0.05);
  const PosedBody body = model.pose(dofs, true);
  const RobustKernel kernel{RobustKernel::Kind::huber, 0.1};
  const auto make_term = [&](double weight) {
    return PointTerm("points", {{3, model.landmark(body, 3) - offset, 0.5}, {6, model.landmark(body, 6), 1.0}}, weight,
                     kernel);
  };
  PointTerm term = make_term(2.0);
  Residuals rows;
  term.evaluate(model, body, true, rows);
  ASSERT_EQ(rows.num_rows(), 6);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(rows.value(i), offset[i], 1e-12);
    EXPECT_NEAR(rows.value(3 + i), 0.0, 1e-12);
    EXPECT_GT(rows.jacobian(3 + i).norm(), 0.1) << "a zero residual has a jacobian too";
  }
  EXPECT_NEAR(rows.cost(), 2.0 * 0.5 * (2.0 * 0.1 * offset.norm() - 0.01), 1e-12);
  support::check_term(term, model, dofs);
  support::check_energy_gradient(term, model, dofs);
  support::check_weight(make_term, model, dofs);
}

}  // namespace
}  // namespace doppel::point_term_test
