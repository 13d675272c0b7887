#include "doppel/track/energy/terms/contour_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::contour_term_test {
namespace {

class ContourTermTest : public ::testing::Test, protected OutlineScene {
 protected:
  ContourTermTest() {
    for (int camera = 0; camera < 2; ++camera)
      for (int v = 0; v < character_.num_vertices(); ++v) vertices_.push_back({camera, v});
  }
  ContourTerm<PoseModel> term(double weight, double farthest = 200.0) const {
    return {cameras_, frame_, vertices_, 30, farthest, weight, {RobustKernel::Kind::geman_mcclure, 30.0}};
  }

  std::vector<OutlineVertex> vertices_;
};

TEST_F(ContourTermTest, JacobianAreCentralDifferences) {
  const std::vector<double> dofs = bent_pose(character_, 0.12);
  ContourTerm<PoseModel> contour = term(4.0);
  support::check_term(contour, model_, dofs, 2e-5);
  support::check_energy_gradient(contour, model_, dofs);
  support::check_weight([&](double weight) { return term(weight); }, model_, dofs);
}

TEST_F(ContourTermTest, MeasuresHowFarTheSurfaceIsAlongTheNormal) {
  std::vector<double> dofs = character_.rest_dofs;
  ContourTerm<PoseModel> contour = term(4.0);
  const Residuals at_rest = support::frozen_rows(contour, model_, dofs);
  ASSERT_GT(at_rest.num_rows(), 50);
  EXPECT_NEAR(at_rest.weight(0), 4.0 / 30.0, 1e-12);
  double before = 0.0, after = 0.0;
  for (Eigen::Index row = 0; row < at_rest.num_rows(); ++row) before += std::abs(at_rest.value(row));
  dofs[0] += 0.1;
  const Residuals moved = support::frozen_rows(contour, model_, dofs);
  for (Eigen::Index row = 0; row < moved.num_rows(); ++row) after += std::abs(moved.value(row));
  EXPECT_GT(after / moved.num_rows(), 3.0 * before / at_rest.num_rows());
}

TEST_F(ContourTermTest, AVertexInsideOfTheOutlineShouldLieAsFarInsideTheMask) {
  ContourTerm<PoseModel> on_outline = term(4.0);
  const Residuals before = support::frozen_rows(on_outline, model_, character_.rest_dofs);
  for (OutlineVertex& vertex : vertices_) vertex.distance = -1.5;
  ContourTerm<PoseModel> inside = term(4.0);
  const Residuals after = support::frozen_rows(inside, model_, character_.rest_dofs);
  ASSERT_EQ(after.num_rows(), before.num_rows());
  for (Eigen::Index row = 0; row < after.num_rows(); ++row)
    EXPECT_NEAR(after.value(row), before.value(row) + 1.5, 1e-9);
}

TEST_F(ContourTermTest, PointsWithoutAPartnerHaveNoRow) {
  std::vector<double> dofs = character_.rest_dofs;
  dofs[1] += 30.0;
  ContourTerm<PoseModel> contour = term(4.0);
  EXPECT_EQ(support::frozen_rows(contour, model_, dofs).num_rows(), 0);
  frame_[0].outline = frame_[1].outline = {};
  ContourTerm<PoseModel> nobody = term(4.0);
  EXPECT_EQ(support::frozen_rows(nobody, model_, character_.rest_dofs).num_rows(), 0);
}

TEST(ContourTerm, PartnersFaceTheSameWay) {
  const Character character = make_test_character(4, 12, 20);
  const PoseModel model(character, {}, all_dofs(character));
  const std::vector<PinholeCamera> cameras = ring_of_cameras(1, 256, middle_of(character));
  FrameEvidence frame(1);
  frame[0].outline = OutlineField(mask_of(model, cameras[0], character.rest_dofs), 200);
  const PosedBody body = model.pose(character.rest_dofs, false);
  std::vector<OutlineVertex> all;
  for (int v = 0; v < character.num_vertices(); ++v) all.push_back({0, v});
  std::vector<OutlineVertex> facing_left;
  for (const OutlineVertex& vertex : all)
    if ((project_with_jacobian(cameras[0], model.vertex(body, vertex.vertex))->jacobian *
         model.normal(body, vertex.vertex))
            .x() < 0)
      facing_left.push_back(vertex);
  const auto rows_with = [&](const std::vector<OutlineVertex>& vertices) {
    ContourTerm<PoseModel> term(cameras, frame, vertices, 200, 1000.0, 1.0, {});
    return support::frozen_rows(term, model, character.rest_dofs).num_rows();
  };
  // Points that face right find nobody among those; points that face up or down may.
  EXPECT_LT(rows_with(facing_left), 9 * rows_with(all) / 10);
  EXPECT_GT(rows_with(facing_left), rows_with(all) / 4);
}

}  // namespace
}  // namespace doppel::contour_term_test
