#include "doppel/track/energy/terms/match_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::match_term_test {
namespace {

class MatchTermTest : public ::testing::Test {
 protected:
  MatchTermTest()
      : character_(make_test_character(4)),
        model_(character_, tube_landmarks(4), all_dofs(character_)),
        cameras_(ring_of_cameras(2, 256, middle_of(character_))) {
    const PosedBody rest = model_.pose(character_.rest_dofs, false);
    for (int camera = 0; camera < 2; ++camera)
      for (int vertex = 0; vertex < character_.num_vertices(); vertex += 7) {
        SurfaceMatch match{camera, vertex, cameras_[camera].project(model_.vertex(rest, vertex)), {}};
        match.sureness << 0.8, 0.2, 0.2, 0.5;
        matches_.push_back(match);
      }
  }

  Residuals rows_at(const std::vector<double>& dofs) const {
    Residuals rows;
    MatchTerm(cameras_, matches_, 6.0, kernel_).evaluate(model_, model_.pose(dofs, true), true, rows);
    return rows;
  }

  Character character_;
  PoseModel model_;
  std::vector<PinholeCamera> cameras_;
  std::vector<SurfaceMatch> matches_;
  RobustKernel kernel_{RobustKernel::Kind::geman_mcclure, 30.0};
};

TEST_F(MatchTermTest, CountsSurePixelsOfAnImage1024Wide) {
  matches_[3].pixel += Eigen::Vector2d(-1.0, 2.0);
  const Residuals rows = rows_at(character_.rest_dofs);
  ASSERT_EQ(rows.num_rows(), 2 * static_cast<Eigen::Index>(matches_.size()));
  EXPECT_NEAR(rows.value(6), 4.0 * (0.8 * 1.0 - 0.2 * 2.0), 1e-9);
  EXPECT_NEAR(rows.value(7), 4.0 * (0.2 * 1.0 - 0.5 * 2.0), 1e-9);
  EXPECT_NEAR(rows.value(0), 0.0, 1e-9);
  EXPECT_EQ(rows.weight(0), 6.0);
}

TEST_F(MatchTermTest, JacobiansAreCentralDifferences) {
  MatchTerm term(cameras_, matches_, 2.0, kernel_);
  const std::vector<double> bent = bent_pose(character_, 0.1);
  support::check_term(term, model_, bent, 1e-5);
  support::check_energy_gradient(term, model_, bent);
  support::check_weight([&](double weight) { return MatchTerm(cameras_, matches_, weight, kernel_); }, model_, bent);
}

TEST_F(MatchTermTest, AVertexBehindACameraIsFarFromItsMatch) {
  std::vector<double> dofs = character_.rest_dofs;
  const Eigen::Vector3d beyond = 2.0 * (cameras_[0].centre() - middle_of(character_));
  for (int i = 0; i < 3; ++i) dofs[i] += beyond[i];
  EXPECT_EQ(rows_at(dofs).value(0), kBehindCamera);
}

}  // namespace
}  // namespace doppel::match_term_test
