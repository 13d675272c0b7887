#include "doppel/track/energy/terms/relative_point_term.h"

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::relative_point_term_test {
namespace {

struct Setting {
  Character character = make_test_character();
  PoseModel model{character, tube_landmarks(5), all_dofs(character)};
  std::vector<double> dofs = bent_pose(character, 0.2);
  std::vector<PointTerm::Target> targets(const std::vector<double>& pose, const Eigen::Vector3d& shift) const {
    std::vector<PointTerm::Target> result;
    const PosedBody body = model.pose(pose, false);
    for (int m = 0; m < model.num_landmarks(); m += 2)
      result.push_back({m, model.landmark(body, m) + shift, 1.0 + 0.3 * m});
    return result;
  }
};

TEST(RelativePointTerm, NoShiftChangesAnything) {
  const Setting setting;
  const RelativePointTerm term("joints", setting.targets(setting.dofs, {0.4, -1.0, 7.0}), 5.0);
  Residuals rows;
  term.evaluate(setting.model, setting.model.pose(setting.dofs, false), false, rows);
  EXPECT_EQ(rows.num_groups(), 5);
  EXPECT_NEAR(rows.cost(), 0.0, 1e-20);
}

TEST(RelativePointTerm, IsWhatTheBestShiftLeaves) {
  const Setting setting;
  const std::vector<PointTerm::Target> targets = setting.targets(bent_pose(setting.character, 0.25), {1.0, 2.0, 3.0});
  const PosedBody body = setting.model.pose(setting.dofs, false);
  Residuals rows;
  RelativePointTerm("joints", targets, 1.0).evaluate(setting.model, body, false, rows);
  const auto cost_with_shift = [&](const Eigen::Vector3d& shift) {
    double sum = 0.0;
    for (const PointTerm::Target& target : targets)
      sum += target.weight * (setting.model.landmark(body, target.landmark) - target.point - shift).squaredNorm();
    return sum;
  };
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double weights = 0.0;
  for (const PointTerm::Target& target : targets) {
    best += target.weight * (setting.model.landmark(body, target.landmark) - target.point);
    weights += target.weight;
  }
  best /= weights;
  EXPECT_NEAR(rows.cost(), cost_with_shift(best), 1e-12);
  EXPECT_LT(rows.cost(), cost_with_shift(best + Eigen::Vector3d(0.01, 0.0, 0.0)));
}

TEST(RelativePointTerm, JacobianAndWeight) {
  const Setting setting;
  const auto targets = setting.targets(bent_pose(setting.character, 0.25), {1.0, 2.0, 3.0});
  RelativePointTerm term("joints", targets, 2.0);
  support::check_term(term, setting.model, setting.dofs);
  support::check_energy_gradient(term, setting.model, setting.dofs);
  support::check_weight([&](double weight) { return RelativePointTerm("joints", targets, weight); }, setting.model,
                        setting.dofs);
}

TEST(RelativePointTerm, WithoutPointsThereIsNothing) {
  const Setting setting;
  Residuals rows;
  RelativePointTerm("joints", {}, 1.0).evaluate(setting.model, setting.model.pose(setting.dofs, true), true, rows);
  EXPECT_EQ(rows.num_rows(), 0);
}

}  // namespace
}  // namespace doppel::relative_point_term_test
