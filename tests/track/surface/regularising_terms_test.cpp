#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "doppel/track/surface/edge_weights.h"
#include "doppel/track/surface/length_term.h"
#include "doppel/track/surface/smoothness_term.h"
#include "doppel/track/surface/target_term.h"
#include "track/surface/surface_check.h"

namespace doppel::regularising_terms_test {
namespace {

using support::check_surface_term;
using support::cost_of;
using support::shaken;

struct Patch {
  TriangleMesh mesh = support::bumpy_patch(5);
  MeshTopology topology{mesh};
  Eigen::Matrix3Xd rest = support::columns(mesh.vertices);
  std::vector<double> weights = edge_weights(topology, std::vector<double>(mesh.vertices.size(), 2.0));
  std::vector<double> lengths;
  Patch() {
    for (const auto& [a, b] : topology.edges()) lengths.push_back((rest.col(a) - rest.col(b)).norm());
  }
  const std::vector<Link>& edges() const { return topology.edges(); }
  int num_edges() const { return static_cast<int>(edges().size()); }
};

TEST(EdgeWeights, MeetEachEdgeFromBothEnds) {
  // A triangle with a tail: vertex 2 has three neighbours, 3 has one.
  const MeshTopology topology(4, {{0, 1}, {0, 2}, {1, 2}, {2, 3}});
  const std::vector<double> weights = edge_weights(topology, {1.0, 3.0, 5.0, 7.0});
  ASSERT_EQ(weights.size(), 4u);
  EXPECT_DOUBLE_EQ(weights[0], 2.0 / 2 + 2.0 / 2);  // 0-1
  EXPECT_DOUBLE_EQ(weights[1], 3.0 / 2 + 3.0 / 3);  // 0-2
  EXPECT_DOUBLE_EQ(weights[3], 6.0 / 3 + 6.0 / 1);  // 2-3
}

TEST(SmoothnessTerm, IsTheChangeOfAnEdge) {
  const Patch patch;
  const SmoothnessTerm term(patch.rest, patch.edges(), patch.weights, 10.0);
  Eigen::Matrix3Xd moved = patch.rest;
  moved.colwise() += Eigen::Vector3d(0.3, -0.2, 0.1);
  EXPECT_NEAR(cost_of(term, patch.num_edges(), moved), 0.0, 1e-20) << "a shift changes no edge";
  moved(2, patch.edges()[0][0]) += 0.01;
  const PointRows rows = term.rows(0, moved);
  EXPECT_TRUE(rows.values.isApprox(Eigen::Vector3d(0.0, 0.0, 0.01), 1e-9));
  EXPECT_DOUBLE_EQ(rows.weight, 10.0 * patch.weights[0]);
}

TEST(SmoothnessTerm, JacobianAndWeight) {
  const Patch patch;
  const Eigen::Matrix3Xd moved = shaken(patch.rest, 0.01);
  SmoothnessTerm term(patch.rest, patch.edges(), patch.weights, 1.0),
      heavy(patch.rest, patch.edges(), patch.weights, 3.0);
  EXPECT_EQ(check_surface_term(term, patch.edges(), moved), patch.num_edges());
  EXPECT_EQ(check_surface_term(term, patch.edges(), patch.rest), patch.num_edges())
      << "jacobian where it costs nothing";
  EXPECT_NEAR(cost_of(heavy, patch.num_edges(), moved), 3.0 * cost_of(term, patch.num_edges(), moved), 1e-12);
}

TEST(LengthTerm, IsTheStretchOfAnEdge) {
  const Patch patch;
  const LengthTerm term(patch.edges(), patch.weights, patch.lengths, 10.0);
  const Eigen::AngleAxisd turn(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized());
  const Eigen::Matrix3Xd turned = turn.toRotationMatrix() * patch.rest;
  EXPECT_NEAR(cost_of(term, patch.num_edges(), turned), 0.0, 1e-20) << "a turn stretches nothing";
  EXPECT_NEAR(term.rows(0, 1.1 * patch.rest).values[0], 0.1 * patch.lengths[0], 1e-12);
}

TEST(LengthTerm, JacobianAndWeight) {
  const Patch patch;
  const Eigen::Matrix3Xd moved = shaken(patch.rest, 0.01);
  LengthTerm term(patch.edges(), patch.weights, patch.lengths, 1.0),
      heavy(patch.edges(), patch.weights, patch.lengths, 3.0);
  EXPECT_EQ(check_surface_term(term, patch.edges(), moved), patch.num_edges());
  EXPECT_EQ(check_surface_term(term, patch.edges(), patch.rest), patch.num_edges());
  EXPECT_GT(term.rows(0, patch.rest).jacobian.row(0).norm(), 0.99) << "jacobian where it costs nothing";
  EXPECT_NEAR(cost_of(heavy, patch.num_edges(), moved), 3.0 * cost_of(term, patch.num_edges(), moved), 1e-12);
}

TEST(LengthTerm, AnEdgeWithoutLengthIsFinite) {
  const Patch patch;
  const LengthTerm term(patch.edges(), patch.weights, patch.lengths, 1.0);
  const PointRows rows = term.rows(0, Eigen::Matrix3Xd::Zero(3, patch.rest.cols()));
  EXPECT_DOUBLE_EQ(rows.values[0], -patch.lengths[0]);
  EXPECT_TRUE(rows.jacobian.isZero());
}

TEST(TargetTerm, IsTheWayToThePosition) {
  const Patch patch;
  const Eigen::Matrix3Xd moved = shaken(patch.rest, 0.01);
  const int count = static_cast<int>(patch.rest.cols());
  TargetTerm term("velocity", patch.rest, 1.0), heavy("velocity", patch.rest, 3.0);
  EXPECT_EQ(term.rows(3, moved).values, Eigen::Vector3d(moved.col(3) - patch.rest.col(3)));
  EXPECT_EQ(check_surface_term(term, patch.edges(), moved), count);
  EXPECT_EQ(check_surface_term(term, patch.edges(), patch.rest), count);
  EXPECT_NEAR(cost_of(heavy, count, moved), 3.0 * cost_of(term, count, moved), 1e-12);
}

}  // namespace
}  // namespace doppel::regularising_terms_test
