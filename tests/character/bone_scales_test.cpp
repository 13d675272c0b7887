#include "doppel/character/bone_scales.h"

#include <gmock/gmock.h>

#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::bone_scales_test {
namespace {

using Eigen::Vector3d;

constexpr int kSegments = 4;

class ScaledTube : public ::testing::Test {
 protected:
  std::vector<Eigen::Affine3d> posed(const Character& character) const {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 6; d < dofs.size(); ++d) dofs[d] += 0.4 * std::sin(1.7 * static_cast<double>(d));
    return character.skeleton.pose(dofs);
  }
  Character tube_ = make_test_character(kSegments);
  BoneScales family_{tube_};
};

TEST_F(ScaledTube, HasAFactorForEverySegmentButTheFirst) {
  ASSERT_EQ(family_.num_parameters(), kSegments - 1);
  EXPECT_EQ(family_.parameters()[0].name, "seg1");
  EXPECT_EQ(family_.mean(), std::vector<double>(kSegments - 1, 1.0));
}

TEST_F(ScaledTube, FactorsOf1ChangeNothing) {
  const Character same = family_.character(family_.mean());
  EXPECT_EQ(same.mesh.vertices, tube_.mesh.vertices);
  for (std::size_t j = 0; j < tube_.skeleton.joints.size(); ++j)
    EXPECT_EQ(same.skeleton.joints[j].offset, tube_.skeleton.joints[j].offset);
}

TEST_F(ScaledTube, BonesHaveTheLengthInEveryPoseAndTheOthersKeepTheirs) {
  const std::vector<double> factors{1.3, 1.0, 0.7};
  const Character scaled = family_.character(factors);
  EXPECT_EQ(scaled.fingerprint(), tube_.fingerprint());
  const std::vector<Joint>& joints = tube_.skeleton.joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double length = joints[j].offset.norm();
    if (length < BoneScales::kMinLength || joints[j].parent < 0) continue;
    const int segment = bone_name(joints[j].name).back() - '1';
    EXPECT_NEAR(scaled.skeleton.joints[j].offset.norm(), factors[segment] * length, 1e-12) << joints[j].name;
  }
}

TEST_F(ScaledTube, TheSurfaceMovesWithTheJoints) {
  // Vertices on the axis between two joints of a straight tube are spread evenly; those beyond the last joint shift.
  Character straight = tube_;
  for (Joint& joint : straight.skeleton.joints)
    if (joint.parent >= 0) joint.offset = Vector3d(0, joint.offset.y(), 0);
  std::fill(straight.rest_dofs.begin(), straight.rest_dofs.end(), 0.0);
  const auto rest = straight.skeleton.pose(straight.rest_dofs);
  const int first = straight.bone_joint[0];
  const Vector3d start = rest[first].translation();
  for (int v = 0; v < straight.num_vertices(); ++v) {
    auto& bones = straight.skin.vertex_bones;
    const auto row = bones.row(v);
    for (std::size_t i = 0; i < row.size(); ++i) {  // all weight on the first bone
      const auto at = as_size(bones.offsets[v]) + i;
      straight.skin.weights[at] = i == 0 ? 1.0 : 0.0;
      bones.items[at] = i == 0 ? 0 : bones.items[at];
    }
  }
  const double length = test_character::kSegment;
  const Character longer = BoneScales(straight).character(std::vector<double>{1.5, 1.0, 1.0});
  for (int v = 0; v < straight.num_vertices(); ++v) {
    const Vector3d &before = straight.mesh.vertices[v], &after = longer.mesh.vertices[v];
    const double along = std::clamp(before.y() - start.y(), 0.0, length);
    EXPECT_LT((after - before - Vector3d(0, 0.5 * along, 0)).norm(), 1e-9) << v;
  }
}

TEST_F(ScaledTube, SidesShareAFactor) {
  Character person = tube_;
  std::vector<Joint>& joints = person.skeleton.joints;
  const auto rename = [&](const std::string& from, const std::string& to) {
    for (Joint& joint : joints)
      if (bone_name(joint.name) == from) joint.name = to + joint.name.substr(from.size());
  };
  std::string left = "Seg1", right = "Seg2";
  for (const auto& [new_left, new_right] :
       {std::pair{"LeftArm", "RightArm"}, {"arm-l", "arm-r"}, {"L.arm", "R.arm"}, {"l-arm", "r-arm"}}) {
    rename(std::exchange(left, new_left), new_left);
    rename(std::exchange(right, new_right), new_right);
    const BoneScales family(person);
    ASSERT_EQ(family.num_parameters(), 2) << left;
    EXPECT_EQ(family.parameters()[0].name, "arm");
  }
}

TEST_F(ScaledTube, AnotherNumberOfFactorsIsRefused) {
  const auto message =
      support::message_of<UsageError>([&] { static_cast<void>(family_.character(std::vector<double>{1.0})); });
  EXPECT_THAT(message, ::testing::HasSubstr("has 3 bones with a length, not 1"));
}

TEST(MarkersNamed, AreInTheOrderOfTheNamesAndNamedWhenMissing) {
  Skeleton skeleton;
  skeleton.markers = {{"a", 0, Vector3d::Zero(), 0.0}, {"b", 1, Vector3d::Zero(), 0.0}};
  const auto found = markers_named(skeleton, {"b", "a"});
  EXPECT_EQ(found[0].joint, 1);
  EXPECT_EQ(found[1].joint, 0);
  EXPECT_THAT(support::message_of<Error>([&] { markers_named(skeleton, {"c"}); }), ::testing::HasSubstr("no marker c"));
}

}  // namespace
}  // namespace doppel::bone_scales_test
