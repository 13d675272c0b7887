#include <gtest/gtest.h>

#include "doppel/core/as_size.h"
#include "doppel/track/energy/terms/arap_term.h"
#include "doppel/track/energy/terms/contour_term.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/node_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

/// The terms of the surface fit, on a graph that is bent.
namespace doppel::graph_terms_test {
namespace {

class GraphTerms : public ::testing::Test {
 protected:
  GraphTerms()
      : character_(make_test_character(3, 8, 10)),
        landmarks_(tube_landmarks(3)),
        model_(character_, landmarks_),
        cameras_(ring_of_cameras(2, 256, middle_of(character_))),
        frame_(keypoints_of(PoseModel(character_, landmarks_, {}), cameras_, character_.rest_dofs)) {
    model_.set_pose(bent_pose(character_, 0.3));
    for (std::size_t i = 0; i < as_size(model_.num_unknowns()); ++i)
      bent_.push_back((i % 6 < 3 ? 0.3 : 0.03) * std::sin(0.7 + 1.7 * static_cast<double>(i)));
    const PoseModel poses(character_, {}, {});
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      frame_[c].outline = OutlineField(mask_of(poses, cameras_[c], character_.rest_dofs), 200);
    for (int v = 0; v < character_.num_vertices(); v += 3) vertices_.push_back({v % 2, v});
  }

  template <typename MakeTerm>
  void check(const MakeTerm& make_term, double tolerance = 1e-6) {
    auto term = make_term(2.0);
    support::check_term<GraphModel>(term, model_, bent_, tolerance);
    support::check_energy_gradient<GraphModel>(term, model_, bent_);
    support::check_weight<GraphModel>(make_term, model_, bent_);
  }

  Character character_;
  std::vector<Marker> landmarks_;
  GraphModel model_;
  std::vector<PinholeCamera> cameras_;
  FrameEvidence frame_;
  std::vector<OutlineVertex> vertices_;
  std::vector<double> bent_;
  RobustKernel kernel_{RobustKernel::Kind::geman_mcclure, 60.0};
};

TEST_F(GraphTerms, KeypointsHaveTheJacobianOfCentralDifferences) {
  check([&](double weight) { return KeypointTerm<GraphModel>(cameras_, frame_, weight, kernel_); }, 1e-5);
}

TEST_F(GraphTerms, OutlinesHaveTheJacobianOfCentralDifferences) {
  check([&](double weight) { return SilhouetteTerm<GraphModel>(cameras_, frame_, vertices_, weight, 0.5, kernel_); },
        2e-5);
}

TEST_F(GraphTerms, ContoursHaveTheJacobianOfCentralDifferences) {
  check([&](double weight) { return ContourTerm<GraphModel>(cameras_, frame_, vertices_, 20, 400.0, weight, kernel_); },
        2e-5);
}

TEST_F(GraphTerms, ArapMeasuresWhatNeighboursPredict) {
  check([&](double weight) { return ArapTerm(model_, weight); });
  // Moved and turned as a whole, nothing is strained; one node moved strains its edges alone.
  std::vector<double> rigid = model_.undeformed();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()).toRotationMatrix();
  for (int k = 0; k < model_.num_nodes(); ++k) {
    const Eigen::Vector3d node = model_.nodes()[k];
    const Eigen::Vector3d position = turn * node + Eigen::Vector3d(0.1, 0.2, 0.3) - node;
    rigid[6 * k + 1] = 0.4;
    for (int i = 0; i < 3; ++i) rigid[6 * k + 3 + i] = position[i];
  }
  ArapTerm term(model_, 5.0);
  EXPECT_NEAR(support::frozen_rows<GraphModel>(term, model_, rigid).cost(), 0.0, 1e-20);
  std::vector<double> moved = model_.undeformed();
  moved[4] = 0.02;
  double expected = 0.0;
  for (const auto& edge : character_.graph.edges) expected += edge[0] == 0 || edge[1] == 0;
  const BlockResiduals rows = support::frozen_rows<GraphModel>(term, model_, moved);
  double unweighted = 0.0;
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) unweighted += std::pow(rows.value(row), 2);
  EXPECT_NEAR(unweighted, 2.0 * expected * 0.0004, 1e-12) << "both directions";
}

TEST_F(GraphTerms, NodesAreHeldInMetres) {
  check([&](double weight) { return NodeTerm("rest", model_, model_.undeformed(), weight); });
  std::vector<double> moved = model_.undeformed();
  moved[6 + 5] = 0.03;
  NodeTerm term("rest", model_, model_.undeformed(), 4.0);
  EXPECT_NEAR(support::frozen_rows<GraphModel>(term, model_, moved).cost(), 4.0 * 0.0009 / model_.num_nodes(), 1e-15);
}

}  // namespace
}  // namespace doppel::graph_terms_test
