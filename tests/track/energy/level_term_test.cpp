#include "doppel/track/energy/terms/level_term.h"

#include "doppel/track/energy/terms/silhouette_term.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::level_term_test {
namespace {

/// The outline of the rest pose in one camera.
std::unique_ptr<PoseTerm> silhouette(const OutlineScene& scene, const RobustKernel& kernel = {}) {
  std::vector<OutlineVertex> outline;
  for (int v = 0; v < scene.character_.num_vertices(); v += 3) outline.push_back({0, v, 0.0});
  return std::make_unique<SilhouetteTerm<PoseModel>>(scene.cameras_, scene.frame_, outline, 100.0, 1.0, kernel);
}

TEST(LevelTerm, ACommonDistanceIsFree) {
  const OutlineScene scene;
  const std::vector<double> dofs = bent_pose(scene.character_, 0.05);
  LevelTerm term(silhouette(scene));
  const Residuals rows = support::frozen_rows(term, scene.model_, dofs);
  const auto plain = silhouette(scene);
  const Residuals others = support::frozen_rows(*plain, scene.model_, dofs);
  ASSERT_GT(rows.num_rows(), 10);
  double sum = 0.0;
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) sum += rows.value(row);
  EXPECT_NEAR(sum, 0.0, 1e-9) << "equal weights";
  EXPECT_LT(rows.cost(), others.cost());
  for (Eigen::Index row = 1; row < rows.num_rows(); ++row)
    EXPECT_NEAR(rows.value(row) - rows.value(0), others.value(row) - others.value(0), 1e-9);
}

TEST(LevelTerm, JacobianUnderAKernel) {
  const OutlineScene scene;
  const std::vector<double> dofs = bent_pose(scene.character_, 0.05);
  LevelTerm term(silhouette(scene, RobustKernel::geman_mcclure_of(20.0)));
  support::check_term(term, scene.model_, dofs, 1e-4);
}

}  // namespace
}  // namespace doppel::level_term_test
