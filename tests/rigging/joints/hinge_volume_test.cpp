#include "doppel/rigging/joints/hinge_volume.h"

#include <gtest/gtest.h>

#include "doppel/rigging/joints/hinges.h"
#include "doppel/rigging/weights/bend_report.h"
#include "rigging/bent_arm.h"

namespace doppel::hinge_volume_test {
namespace {

using support::BentArm;

/// The share of its volume that the elbow has when it is bent.
double elbow_of(BentArm& arm) {
  arm.set_skin();
  return examine_bending(arm.character).poses[1].elbow_volume.value();
}

TEST(Hinges, AreTwoElbowsAndTwoKneesThatBendForwardsAndBackwards) {
  const BentArm arm(0.0);
  const std::vector<Hinge> hinges = find_hinges(arm.character);
  ASSERT_EQ(hinges.size(), 4u);
  for (const Hinge& hinge : hinges) {
    const Eigen::Vector3d way = hinge.axis.cross(hinge.positions.end - hinge.positions.joint);
    EXPECT_GT(hinge.knee ? -way.z() : way.z(), 0.1);
    EXPECT_FALSE(hinge.below[static_cast<std::size_t>(hinge.limb[0])]);
    EXPECT_TRUE(hinge.below[static_cast<std::size_t>(hinge.limb[1])]);
  }
}

TEST(HingeVolume, AnAxisOffTheMiddleCostsItsDistanceTimesTheAngle) {
  // A tube in front of the bones has its middle on the inner side of the elbow.
  for (const double forward : {-0.02, -0.01, 0.01, 0.02}) {
    BentArm arm(forward);
    const double angle = 2.4, length = 0.5 * (0.27 + 0.25);
    EXPECT_NEAR(elbow_of(arm), 1 - angle * forward / length, 0.03) << forward;
  }
}

TEST(HingeVolume, IsKeptByATransitionThatIsLongerOnTheOuterSide) {
  for (const double forward : {-0.02, -0.01, 0.01, 0.02}) {
    BentArm arm(forward);
    keep_hinge_volumes(arm.field, arm.character);
    EXPECT_NEAR(elbow_of(arm), 1.0, 0.02) << forward;
  }
}

TEST(HingeVolume, KeepsWeightsThatSumToOneAndRiseAlongTheArm) {
  BentArm arm(0.03);  // so far that the strongest change is needed
  keep_hinge_volumes(arm.field, arm.character);
  const auto below = [&](int v) { return arm.field(v, arm.bone("LeftForeArm")); };
  const int rings = (arm.character.num_vertices() - 2) / support::kTubeCorners;
  for (int v = 0; v < rings * support::kTubeCorners; ++v) {
    EXPECT_NEAR(arm.field.row(v).sum(), 1.0F, 1e-5F);
    EXPECT_GE(arm.field.row(v).minCoeff(), 0.0F);
    if (v >= support::kTubeCorners) {
      EXPECT_GE(below(v), below(v - support::kTubeCorners) - 1e-5F) << v;
    }
  }
}

TEST(HingeVolume, ACentredTubeStaysAsItIs) {
  BentArm arm(0.0);
  const WeightField before = arm.field;
  keep_hinge_volumes(arm.field, arm.character);
  EXPECT_LT((arm.field - before).cwiseAbs().maxCoeff(), 0.03F);
}

}  // namespace
}  // namespace doppel::hinge_volume_test
