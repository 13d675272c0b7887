#include "doppel/eval/pose_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::pose_metrics_test {
namespace {

using support::message_of;
using test::is_near;
using ::testing::HasSubstr;
using torch::Tensor;

/// A person of plain numbers, metres; every bone along an axis.
Tensor person() {
  return torch::tensor({{{0.0, 1.7, 0.0},   // head
                         {0.0, 1.5, 0.0},   // neck
                         {-0.2, 1.5, 0.0},  // right shoulder
                         {-0.5, 1.5, 0.0},  // elbow
                         {-0.8, 1.5, 0.0},  // wrist
                         {0.2, 1.5, 0.0},   // left
                         {0.5, 1.5, 0.0},
                         {0.8, 1.5, 0.0},
                         {-0.1, 1.0, 0.0},  // right hip
                         {-0.1, 0.5, 0.0},  // knee
                         {-0.1, 0.1, 0.0},  // ankle
                         {0.1, 1.0, 0.0},   // left
                         {0.1, 0.5, 0.0},
                         {0.1, 0.1, 0.0}}},
                       torch::kFloat64);
}
Tensor turn_about_y(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return torch::tensor({{c, 0.0, s}, {0.0, 1.0, 0.0}, {-s, 0.0, c}}, torch::kFloat64);
}

TEST(PoseMetrics, ThePersonItselfIsPerfect) {
  const PoseScores scores = compare_poses(person(), person());
  EXPECT_EQ(scores.frames, 1);
  EXPECT_EQ(scores.missing, 0);
  EXPECT_NEAR(scores.GLE_mm, 0.0, 1e-9);
  EXPECT_DOUBLE_EQ(scores.PCK, 100.0);
  EXPECT_NEAR(scores.AUC, 100.0, 1e-9);
  EXPECT_NEAR(scores.MPJPE_mm, 0.0, 1e-9);
}

TEST(PoseMetrics, AShiftIsAnErrorOfPositionOnly) {
  const PoseScores scores = compare_poses(person() + torch::tensor({0.03, 0.0, 0.04}, torch::kFloat64), person());
  EXPECT_NEAR(scores.GLE_mm, 50.0, 1e-9);
  EXPECT_DOUBLE_EQ(scores.PCK, 100.0);
  EXPECT_NEAR(scores.MPJPE_mm, 0.0, 1e-9);
}

TEST(PoseMetrics, AnotherSizeIsNoError) {
  const Tensor root = torch::tensor({0.0, 1.0, 0.0}, torch::kFloat64);
  Tensor taller = root + 1.2 * (person() - root);
  taller.narrow(1, 5, 3) += torch::tensor({0.1, 0.0, 0.0}, torch::kFloat64);  // a longer left clavicle
  EXPECT_TRUE(is_near(rescale_bones(taller, person()), person(), 1e-12));
  const PoseScores scores = compare_poses(taller, person());
  EXPECT_NEAR(scores.AUC, 100.0, 1e-9);
  EXPECT_NEAR(scores.GLE_mm, 0.0, 1e-9);
}

TEST(PoseMetrics, ATurnedPersonHasNoErrorAfterAlignment) {
  const Tensor turned = torch::matmul(person(), turn_about_y(M_PI / 2).t());
  const PoseScores scores = compare_poses(turned, person());
  EXPECT_NEAR(scores.MPJPE_mm, 0.0, 1e-6);
  // A joint d metres from the axis moves by d sqrt(2): the head, the neck and hips, knees, ankles (141 mm) are within
  // 150 mm; shoulders (283 mm), elbows and wrists are not.
  EXPECT_NEAR(scores.PCK, 100.0 * 8 / 14, 1e-9);
  // Head and neck pass all 31 thresholds, the six of the legs 145 and 150.
  EXPECT_NEAR(scores.AUC, 100.0 * (2 * 31 + 6 * 2) / (14.0 * 31.0), 1e-9);
}

TEST(PoseMetrics, OneWrongElbowCountsAsMuchAsItIs) {
  Tensor bent = person();
  // The right forearm points forward: the wrist is 0.3 sqrt(2) m off, nothing else.
  bent[0][4] = torch::tensor({-0.5, 1.5, 0.3}, torch::kFloat64);
  EXPECT_NEAR(compare_poses(bent, person()).PCK, 100.0 * 13 / 14, 1e-9);
}

TEST(PoseMetrics, FramesWithoutAPoseCountAsWrong) {
  Tensor found = person().repeat({4, 1, 1});
  found[1][3][0] = std::numeric_limits<double>::quiet_NaN();
  found[3].fill_(std::numeric_limits<double>::infinity());
  const PoseScores scores = compare_poses(found, person().repeat({4, 1, 1}));
  EXPECT_EQ(scores.missing, 2);
  EXPECT_DOUBLE_EQ(scores.PCK, 50.0);
  EXPECT_NEAR(scores.AUC, 50.0, 1e-9);
  EXPECT_NEAR(scores.MPJPE_mm, 0.0, 1e-9);
  found.fill_(std::numeric_limits<double>::quiet_NaN());
  const auto json = compare_poses(found, person().repeat({4, 1, 1})).to_json();
  EXPECT_EQ(json["3DPCK"], 0.0);
  EXPECT_FALSE(json.contains("MPJPE_mm"));
}

TEST(PoseMetrics, APersonInOnePointHasFiniteErrors) {
  const PoseScores scores = compare_poses(torch::zeros({1, 14, 3}), person());
  EXPECT_TRUE(std::isfinite(scores.MPJPE_mm));
  EXPECT_NEAR(scores.GLE_mm, 1000.0, 1e-6);
}

TEST(PoseMetrics, RejectsOtherShapes) {
  EXPECT_THAT(message_of<UsageError>([] {
                compare_poses(torch::zeros({1, 13, 3}), person());
              }),
              HasSubstr("[frames,14,3]"));
  EXPECT_THAT(message_of<UsageError>([] {
                compare_poses(torch::zeros({0, 14, 3}), person());
              }),
              HasSubstr("at least one"));
  EXPECT_THAT(message_of<UsageError>([] { compare_poses(torch::zeros({2, 14, 3}), person()); }), HasSubstr("2 frames"));
  EXPECT_THAT(message_of<UsageError>([] { compare_poses(person(), person() / 0.0); }), HasSubstr("ground truth"));
}

TEST(SimilarityAlignment, UndoesAnySimilarity) {
  const Tensor points = torch::randn({2, 6, 3}, at::detail::createCPUGenerator(1), torch::kFloat64);
  const Tensor moved =
      0.4 * torch::matmul(points, turn_about_y(2.0)) + torch::tensor({1.0, -2.0, 3.0}, torch::kFloat64);
  EXPECT_TRUE(is_near(align_similarity(moved, points), points, 1e-12));
}

TEST(SimilarityAlignment, NeverMirrors) {
  const Tensor points = torch::randn({1, 6, 3}, at::detail::createCPUGenerator(1), torch::kFloat64);
  const Tensor mirrored = points * torch::tensor({-1.0, 1.0, 1.0}, torch::kFloat64);
  EXPECT_GT((align_similarity(mirrored, points) - points).norm().item<double>(), 0.1);
}

TEST(CommonJoints, AreFoundUnderAnySpelling) {
  std::vector<std::string> body25{"Nose",   "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist",
                                  "MidHip", "RHip", "RKnee",     "RAnkle", "LHip",   "LKnee",     "LAnkle", "REye"};
  EXPECT_THAT(common_joint_rows(body25), testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14));
  body25[3] = "elbow";
  EXPECT_THAT(message_of<UsageError>([&] { common_joint_rows(body25); }), HasSubstr("right_elbow"));
}

}  // namespace
}  // namespace doppel::pose_metrics_test
