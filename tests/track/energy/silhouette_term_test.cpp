#include "doppel/track/energy/terms/silhouette_term.h"

#include <gtest/gtest.h>

#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::silhouette_term_test {
namespace {

class SilhouetteTermTest : public ::testing::Test, protected OutlineScene {
 protected:
  SilhouetteTermTest() {
    for (int v = 0; v < character_.num_vertices(); v += 5) vertices_.push_back({v % 2, v});
  }

  std::vector<OutlineVertex> vertices_;
  RobustKernel kernel_{RobustKernel::Kind::geman_mcclure, 30.0};
};

TEST_F(SilhouetteTermTest, JacobianAreCentralDifferences) {
  const std::vector<double> dofs = bent_pose(character_, 0.12);
  SilhouetteTerm<PoseModel> term(cameras_, frame_, vertices_, 10.0, 0.3, kernel_);
  support::check_term(term, model_, dofs, 2e-5);
  support::check_energy_gradient(term, model_, dofs);
  support::check_weight(
      [&](double weight) { return SilhouetteTerm<PoseModel>(cameras_, frame_, vertices_, weight, 0.3, kernel_); },
      model_, dofs);
}

TEST_F(SilhouetteTermTest, EachCameraCountsItsWeightHoweverManyVertices) {
  SilhouetteTerm<PoseModel> term(cameras_, frame_, {{0, 1}, {0, 2}, {0, 3}, {1, 4}}, 6.0, 1.0, {});
  Residuals rows;
  term.evaluate(model_, model_.pose(character_.rest_dofs, false), false, rows);
  ASSERT_EQ(rows.num_groups(), 4);
  EXPECT_NEAR(rows.weight(0), 2.0, 1e-12);
  EXPECT_NEAR(rows.weight(3), 6.0, 1e-12);
}

TEST_F(SilhouetteTermTest, ACameraThatSeesNobodyHasNoRows) {
  frame_[1].outline = OutlineField(cv::Mat::zeros(256, 256, CV_8UC1), 200);
  EXPECT_TRUE(frame_[1].outline.empty());
  SilhouetteTerm<PoseModel> term(cameras_, frame_, {{0, 1}, {1, 2}}, 1.0, 1.0, {});
  Residuals rows;
  const PosedBody body = model_.pose(character_.rest_dofs, false);
  term.freeze(model_, body);
  term.evaluate(model_, body, false, rows);
  EXPECT_EQ(rows.num_rows(), 1);
}

/// An upright strip in the mask, 10 pixels wide, and a vertex inside it that faces right: left of the middle it must
/// go right too, though the left edge is nearer.
TEST(SilhouetteTerm, GoesToTheSideThatTheNormalFaces) {
  cv::Mat mask = cv::Mat::zeros(64, 64, CV_8UC1);
  mask(cv::Rect(20, 5, 10, 50)).setTo(255);
  const OutlineField field(mask, 64, 0.0);
  PinholeCamera camera;
  camera.width = camera.height = 64;
  camera.K << 64, 0, 0, 0, 64, 0, 0, 0, 1;
  camera.t.z() = 1.0;  // a metre is 64 pixels
  const auto side_of = [&](double x, const Eigen::Vector3d& normal) {
    const auto projected = project_with_jacobian(camera, Eigen::Vector3d(x / 64.0, 0.5, 0.0));
    return belongs_to_opposite_outline(*projected, normal, field.at(projected->pixel));
  };
  EXPECT_TRUE(side_of(22.0, Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(side_of(22.0, -Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(side_of(28.0, Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(side_of(17.0, Eigen::Vector3d::UnitX())) << "outside the nearest outline is always right";
}

/// The frozen row of such a vertex costs d^2 and its jacobian is that of -d: the step leads to the far side.
TEST_F(SilhouetteTermTest, TheRowOfAVertexOnTheWrongSideKeepsItsCostAndTurnsItsJacobian) {
  const std::vector<double> dofs = bent_pose(character_, 0.12);
  const PosedBody body = model_.pose(dofs, true);
  SilhouetteTerm<PoseModel> frozen(cameras_, frame_, vertices_, 10.0, 1.0, {}),
      plain(cameras_, frame_, vertices_, 10.0, 1.0, {});
  frozen.freeze(model_, body);
  Residuals rows, reference;
  frozen.evaluate(model_, body, true, rows);
  plain.evaluate(model_, body, true, reference);
  int turned = 0;
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
    EXPECT_NEAR(std::abs(rows.value(row)), std::abs(reference.value(row)), 1e-9);
    EXPECT_LT((rows.jacobian(row) - reference.jacobian(row)).norm(), 1e-9);
    turned += rows.value(row) * reference.value(row) < 0.0;
  }
  EXPECT_GT(turned, 0);
  EXPECT_NEAR(rows.cost(), reference.cost(), 1e-9 * reference.cost());
}

TEST_F(SilhouetteTermTest, InOneGoItsRowsAreThoseOfFreezingAndThenAsking) {
  const PosedBody body = model_.pose(bent_pose(character_, 0.12), true);
  SilhouetteTerm<PoseModel> one(cameras_, frame_, vertices_, 10.0, 1.0, {}),
      two(cameras_, frame_, vertices_, 10.0, 1.0, {});
  Residuals at_once, apart;
  one.linearise(model_, body, at_once);
  two.freeze(model_, body);
  two.evaluate(model_, body, true, apart);
  ASSERT_EQ(at_once.num_rows(), apart.num_rows());
  ASSERT_GT(apart.num_rows(), 0);
  for (Eigen::Index row = 0; row < apart.num_rows(); ++row) {
    EXPECT_EQ(at_once.value(row), apart.value(row));
    EXPECT_EQ(at_once.jacobian(row), apart.jacobian(row));
  }
}

TEST_F(SilhouetteTermTest, WithinTheMaskItCountsAsMuchAsItIsTold) {
  const std::vector<double> dofs = bent_pose(character_, 0.12);
  const PosedBody body = model_.pose(dofs, true);
  Residuals whole, part;
  SilhouetteTerm<PoseModel>(cameras_, frame_, vertices_, 10.0, 1.0, {}).evaluate(model_, body, true, whole);
  SilhouetteTerm<PoseModel>(cameras_, frame_, vertices_, 10.0, 0.25, {}).evaluate(model_, body, true, part);
  int inside = 0;
  for (Eigen::Index row = 0; row < whole.num_rows(); ++row) {
    const double share = whole.value(row) < 0.0 ? 0.5 : 1.0;  // of the residual; 0.25 of its square
    inside += share < 1.0;
    EXPECT_NEAR(part.value(row), share * whole.value(row), 1e-12);
  }
  EXPECT_GT(inside, 0);
  EXPECT_LT(inside, static_cast<int>(whole.num_rows()));
}

TEST(OutlineField, ItsContourLiesBetweenThePixelsAndFacesOut) {
  cv::Mat mask = cv::Mat::zeros(64, 64, CV_8UC1);
  mask(cv::Rect(20, 10, 12, 40)).setTo(255);
  const OutlineField field(mask, 64, 0.0);
  const auto points = field.contour(10000);
  ASSERT_GE(points.size(), 80u);
  for (const auto& point : points) {
    EXPECT_LT(std::abs(field.at(point.pixel).distance), 0.75 * field.box().image_pixels_per_pixel(64));
    EXPECT_NEAR(point.normal.norm(), 1.0, 1e-9);
    EXPECT_GT(field.at(point.pixel + 2.0 * point.normal).distance, 0.0);
    EXPECT_LT(field.at(point.pixel - 2.0 * point.normal).distance, 0.0);
  }
  EXPECT_EQ(field.contour(7).size(), 7u);
}

TEST(OutlineField, IsContinuousAcrossTheEdgeOfItsWindow) {
  cv::Mat mask = cv::Mat::zeros(128, 128, CV_8UC1);
  mask(cv::Rect(50, 40, 20, 40)).setTo(255);
  const OutlineField field(mask, 64);
  const double edge = field.box().u0 + 0.5 * field.box().image_pixels_per_pixel(64);
  const auto inside = field.at({edge + 1e-6, 60.0}), outside = field.at({edge - 1e-6, 60.0});
  EXPECT_NEAR(inside.distance, outside.distance, 1e-5);
  const auto far = field.at({edge - 7.0, 60.0});
  EXPECT_NEAR(far.distance, inside.distance + 7.0, 1e-4);
  EXPECT_NEAR(far.gradient.x(), -1.0, 1e-9);
}

}  // namespace
}  // namespace doppel::silhouette_term_test
