#include "doppel/track/energy/shape_model.h"

#include <gtest/gtest.h>

#include "doppel/character/bone_scales.h"
#include "doppel/character/landmarks.h"
#include "doppel/track/energy/terms/contour_term.h"
#include "doppel/track/energy/terms/distance_term.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/shape_prior_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::shape_model_test {
namespace {

constexpr int kSegments = 4;

Character with_landmarks() {
  Character character = make_test_character(kSegments, 12, 20);
  character.skeleton.markers = tube_landmarks(kSegments);
  return character;
}

/// A tube whose segments have other lengths than those seen by two cameras. Points of the shapes move in proportion to
/// the factors, so forward differences are exact.
class SeenTube : public ::testing::Test {
 protected:
  SeenTube() {
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      frame_[c].outline = OutlineField(mask_of(ground_truth_, cameras_[c], dofs_), 200);
    for (int v = 0; v < character_.num_vertices(); v += 3) outline_.push_back({v % 2, v, 0.0});
  }

  Character character_ = with_landmarks();
  BoneScales family_{character_};
  ShapeSource source_{family_, landmark_names(character_.skeleton.markers)};
  std::vector<double> dofs_ = bent_pose(character_, 0.1);
  ShapeModel model_{source_, dofs_};
  std::vector<double> shape_{1.1, 0.9, 1.2};
  std::vector<PinholeCamera> cameras_ = ring_of_cameras(2, 256, middle_of(character_));
  PoseModel ground_truth_{character_, character_.skeleton.markers, {}};
  FrameEvidence frame_ = keypoints_of(ground_truth_, cameras_, dofs_);
  std::vector<OutlineVertex> outline_;
  RobustKernel kernel_ = RobustKernel::geman_mcclure_of(20.0);
};

TEST_F(SeenTube, OfTheMeanShapeIsTheCharacterInItsPose) {
  const PosedShape shape = model_.pose(family_.mean(), false);
  const PosedBody body = ground_truth_.pose(dofs_, false);
  for (int v = 0; v < character_.num_vertices(); ++v)
    EXPECT_LT((model_.vertex(shape, v) - ground_truth_.vertex(body, v)).norm(), 1e-12);
  for (int m = 0; m < model_.num_landmarks(); ++m)
    EXPECT_LT((model_.landmark(shape, m) - ground_truth_.landmark(body, m)).norm(), 1e-12);
}

TEST_F(SeenTube, JacobiansOfTheTermsAreThoseOfCentralDifferences) {
  KeypointTerm<ShapeModel> keypoints(cameras_, frame_, 1.0, kernel_);
  support::check_term(keypoints, model_, shape_, 1e-5);
  SilhouetteTerm<ShapeModel> silhouette(cameras_, frame_, outline_, 1.0, 0.5, kernel_);
  support::check_energy_gradient<ShapeModel>(silhouette, model_, shape_, 1e-3);
  ContourTerm<ShapeModel> contour(cameras_, frame_, outline_, 50, 200.0, 1.0, kernel_);
  support::check_term(contour, model_, shape_, 1e-5);
  ShapePriorTerm prior(2.0);
  support::check_term(prior, model_, shape_);
  DistanceTerm distances({{{0, 3}, 0.2}, {{2, 5}, 0.4, 0.5}}, 3.0);
  support::check_term(distances, model_, shape_, 1e-5);
}

TEST_F(SeenTube, StepsStayWithinTheRanges) {
  const Eigen::VectorXd far = Eigen::VectorXd::Constant(3, 100.0);
  for (const double value : model_.moved(shape_, far)) EXPECT_EQ(value, family_.parameters()[0].high);
  // At the upper end the differences are taken downwards.
  const std::vector<double> end(3, family_.parameters()[0].high);
  DistanceTerm distances({{{0, 5}, 0.2}}, 1.0);
  EXPECT_LT(source_.at(end, true)->steps[0], 0.0);
  const auto rows = support::frozen_rows<ShapeModel>(distances, model_, end);
  EXPECT_GT(rows.value(0), 0.0);
}

}  // namespace
}  // namespace doppel::shape_model_test
