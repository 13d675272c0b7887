#include "doppel/track/multiview/shape_fit.h"

#include <gmock/gmock.h>

#include "doppel/character/bone_scales.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::shape_fit_test {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Not;

constexpr int kSegments = 4, kFrames = 5;

/// A person whose bones have other lengths than the character's.
class OtherPerson : public ::testing::Test {
 protected:
  OtherPerson() : character_(make_test_character(kSegments, 12, 20)) {
    character_.skeleton.markers = tube_landmarks(kSegments);
    names_ = landmark_names(character_.skeleton.markers);
    family_.emplace(character_);
    person_ = family_->character(ground_truth_);
    cameras_ = ring_of_cameras(4, 256, middle_of(person_));
  }

  std::vector<double> pose(int frame) const { return bent_pose(character_, 0.12, 0.9 * frame); }
  std::vector<PosedEvidence> frames(bool masks) const {
    const PoseModel model(person_, person_.skeleton.markers, {});
    std::vector<PosedEvidence> result;
    for (int f = 0; f < kFrames; ++f) {
      PosedEvidence frame{keypoints_of(model, cameras_, pose(f)), pose(f)};
      for (std::size_t c = 0; masks && c < cameras_.size(); ++c)
        frame.seen[c].outline = OutlineField(mask_of(model, cameras_[c], pose(f)), 160);
      result.push_back(std::move(frame));
    }
    return result;
  }

  Character character_, person_;
  std::vector<std::string> names_;
  std::optional<BoneScales> family_;
  const std::vector<double> ground_truth_{1.25, 0.8, 1.1};
  std::vector<PinholeCamera> cameras_;
};

TEST_F(OtherPerson, HasHisLengthsByKeypoints) {
  ShapeFitOptions options;
  options.rounds = 1;
  const auto found = fit_shape(*family_, names_, cameras_, frames(false), family_->mean(), options);
  for (std::size_t p = 0; p < ground_truth_.size(); ++p) EXPECT_NEAR(found[p], ground_truth_[p], 0.005) << p;
}

TEST_F(OtherPerson, HasHisLengthsByOutlinesAsWell) {
  ShapeFitOptions options;
  options.prior_weight = 0.5;  // this person is far from the usual lengths
  const auto found = fit_shape(*family_, names_, cameras_, frames(true), family_->mean(), options);
  for (std::size_t p = 0; p < ground_truth_.size(); ++p) EXPECT_NEAR(found[p], ground_truth_[p], 0.01) << p;
}

TEST_F(OtherPerson, PairsOnOneBoneAreSteadyAndPairsAcrossAJointAreNot) {
  const auto pairs = steady_pairs(character_, names_, 0.02);
  std::vector<std::array<int, 2>> found;
  for (const SteadyPair& pair : pairs) found.push_back(pair.landmarks);
  EXPECT_THAT(found, Contains(ElementsAre(4, 5)));
  EXPECT_THAT(found, Not(Contains(ElementsAre(2, 6))));
  EXPECT_LT(pairs.front().deviation, 0.02);
}

TEST_F(OtherPerson, TheFirstShapeComesFromDistancesInSpace) {
  std::vector<SpaceLandmarks> seen;
  const PoseModel model(person_, person_.skeleton.markers, {});
  for (int f = 0; f < kFrames; ++f) {
    const PosedBody body = model.pose(pose(f), false);
    SpaceLandmarks landmarks;
    for (int m = 0; m < model.num_landmarks(); ++m) landmarks.emplace_back(model.landmark(body, m));
    if (f == 0) landmarks[4] = Eigen::Vector3d(9, 9, 9);  // one outlier
    if (f == 1) landmarks[5].reset();
    seen.push_back(std::move(landmarks));
  }
  const auto first = shape_from_landmarks(*family_, names_, seen);
  for (std::size_t p = 0; p < ground_truth_.size(); ++p)
    EXPECT_NEAR(first[p], ground_truth_[p], 0.35 * std::abs(ground_truth_[p] - 1.0)) << p;
  EXPECT_THAT(shape_from_landmarks(*family_, names_, {}), Each(::testing::DoubleNear(1.0, 1e-12)));
}

TEST_F(OtherPerson, NoFrameIsAnError) {
  const auto message =
      support::message_of<Error>([&] { fit_shape(*family_, names_, cameras_, {}, ground_truth_, {}); });
  EXPECT_THAT(message, ::testing::HasSubstr("no frame to fit the shape to"));
}

}  // namespace
}  // namespace doppel::shape_fit_test
