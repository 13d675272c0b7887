// Fingers of the parametric body: joints, couplings, and skinning weights that keep neighbours apart.
#include "doppel/rigging/joints/fingers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "doppel/rigging/body/body_model.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/joints/body_skeleton.h"
#include "support/message_of.h"

namespace doppel::fingers_test {
namespace {

using Eigen::Vector3d;

const BodyModel& model() {
  static const BodyModel kModel(3000, 200);
  return kModel;
}
const BodyJoints& joints() {
  static const BodyJoints kJoints = model().joints(mean_measures());
  return kJoints;
}
const Character& person() {
  static const Character kPerson = model().character("person", mean_measures());
  return kPerson;
}

/// World position of a marker in a pose.
Vector3d marker(const std::vector<double>& dofs, const std::string& name) {
  const std::vector<Marker>& markers = person().skeleton.markers;
  const Marker& found =
      *std::find_if(markers.begin(), markers.end(), [&](const Marker& marker) { return marker.name == name; });
  return person().skeleton.pose(dofs)[static_cast<std::size_t>(found.joint)] * found.position;
}

/// The rest pose with a DoF changed.
std::vector<double> with(const std::string& dof, double change) {
  std::vector<double> dofs = person().rest_dofs;
  dofs[static_cast<std::size_t>(person().skeleton.find_dof(dof).value())] += change;
  return dofs;
}

Vector3d at(const std::string& name) { return joints().at(name); }
/// The side of the palm, unit.
Vector3d palm(const std::string& side) {
  const double s = side == "left_" ? -1 : 1;
  return s * (at(side + "forefinger1") - at(side + "wrist"))
                 .cross(at(side + "pinky_finger1") - at(side + "wrist"))
                 .normalized();
}
const char* hand(const std::string& side) { return side == "left_" ? "LeftHand" : "RightHand"; }

class Hands : public ::testing::TestWithParam<std::string> {};

TEST_P(Hands, PointsAreMarkersAtRest) {
  for (const Finger& finger : kFingers)
    for (int k = 1; k <= kFingerPoints; ++k) {
      const std::string name = finger_point(GetParam(), finger, k);
      EXPECT_LT((marker(person().rest_dofs, name) - at(name)).norm(), 1e-9) << name;
    }
}

TEST_P(Hands, FingersBendToThePalmAndSpreadToTheThumb) {
  const Vector3d towards_thumb = (at(GetParam() + "forefinger1") - at(GetParam() + "pinky_finger1")).normalized();
  for (std::size_t f = 1; f < kFingers.size(); ++f) {
    const std::string bone = finger_bone(GetParam(), kFingers[f], 1), tip = finger_point(GetParam(), kFingers[f], 4);
    const double length = (at(tip) - at(finger_point(GetParam(), kFingers[f], 1))).norm();
    EXPECT_GT((marker(with(bone + "_rz", 0.3), tip) - at(tip)).dot(palm(GetParam())), 0.25 * length) << tip;
    EXPECT_GT((marker(with(bone + "_ry", 0.2), tip) - at(tip)).dot(towards_thumb), 0.15 * length) << tip;
  }
}

TEST_P(Hands, TheThumbBendsAcrossThePalm) {
  const std::string tip = GetParam() + "thumb4";
  const Vector3d moved = marker(with(finger_bone(GetParam(), kFingers[0], 2) + "_rx", 0.5), tip) - at(tip);
  EXPECT_GT(moved.dot(palm(GetParam())), 0.005);
  EXPECT_GT(moved.dot((at(GetParam() + "pinky_finger1") - at(GetParam() + "forefinger1")).normalized()), 0.005);
}

TEST_P(Hands, TheLastJointFollowsTheOneBefore) {
  const auto angle = [&](int k) {  // between the bones at point k, after a bend of 1
    const std::vector<double> bent = with(finger_bone(GetParam(), kFingers[1], 2) + "_rz", 1.0);
    const auto point = [&](int i, const std::vector<double>& dofs) {
      return marker(dofs, finger_point(GetParam(), kFingers[1], i));
    };
    const auto bend = [&](const std::vector<double>& dofs) {
      const Vector3d before = point(k, dofs) - point(k - 1, dofs), after = point(k + 1, dofs) - point(k, dofs);
      return std::atan2(before.cross(after).norm(), before.dot(after));
    };
    return bend(bent) - bend(person().rest_dofs);
  };
  EXPECT_NEAR(angle(2), 1.0, 0.02);
  EXPECT_NEAR(angle(3) / angle(2), 0.67, 0.02);
}

TEST_P(Hands, AVertexOfAFingerDoesNotMoveWithAnother) {
  const SkinningWeights& skin = person().skin;
  // Around the last bone of a finger, all weights are those of its own bones.
  int seen = 0;
  for (int v = 0; v < person().num_vertices(); ++v) {
    const Vector3d& p = person().mesh.vertices[static_cast<std::size_t>(v)];
    for (const Finger& finger : kFingers) {
      const Vector3d tip = at(finger_point(GetParam(), finger, 4)), joint = at(finger_point(GetParam(), finger, 3));
      if ((p - 0.5 * (tip + joint)).norm() > 0.5 * (tip - joint).norm()) continue;
      ++seen;
      double own = 0.0;
      const auto bones = skin.vertex_bones.row(v);
      const auto weights = skin.vertex_bones.row_of(skin.weights, v);
      for (std::size_t i = 0; i < bones.size(); ++i)
        if (skin.bones[static_cast<std::size_t>(bones[i])].starts_with(hand(GetParam()) + std::string(finger.bone)))
          own += weights[i];
      EXPECT_NEAR(own, 1.0, 0.02) << finger.point << " vertex " << v;
    }
  }
  EXPECT_GT(seen, 20);
}

INSTANTIATE_TEST_SUITE_P(BothSides, Hands, ::testing::Values("left_", "right_"));

/// The weight of each vertex for the hand and its fingers.
std::vector<double> hand_weights(const Character& character) {
  std::vector<double> sums(character.mesh.vertices.size(), 0.0);
  for (int v = 0; v < character.num_vertices(); ++v) {
    const auto bones = character.skin.vertex_bones.row(v);
    const auto weights = character.skin.vertex_bones.row_of(character.skin.weights, v);
    for (std::size_t i = 0; i < bones.size(); ++i)
      if (character.skin.bones[static_cast<std::size_t>(bones[i])].starts_with("LeftHand"))
        sums[static_cast<std::size_t>(v)] += weights[i];
  }
  return sums;
}

TEST(Fingers, DividingKeepsTheWeightOfTheHand) {
  // A rig whose hands are one bone each: the weights of the forearm fall to 0 over 4 cm behind the wrist.
  Character character = person();
  SkinningWeights& skin = character.skin;
  skin = SkinningWeights();
  skin.bones = {"LeftForeArmRoll", "LeftHand", "RightHand"};
  skin.vertex_bones.offsets = {0};
  const Vector3d along = (at("left_fingertip") - at("left_wrist")).normalized();
  for (const Vector3d& p : character.mesh.vertices) {
    const double hand = std::clamp(((p - at("left_wrist")).dot(along) + 0.02) / 0.04, 0.0, 1.0);
    for (const auto& [bone, weight] : {std::pair(0, 1 - hand), std::pair(1, hand)})
      if (weight > 0.0) {
        skin.vertex_bones.items.push_back(bone);
        skin.weights.push_back(weight);
      }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  const std::vector<double> before = hand_weights(character);
  divide_hand_weights(character, joints());
  const std::vector<double> after = hand_weights(character);
  // Weights below 1 % of a vertex are dropped, of at most nine bones.
  for (std::size_t v = 0; v < before.size(); ++v) EXPECT_NEAR(after[v], before[v], 0.09) << v;
  EXPECT_EQ(character.skin.num_bones(), 3 + 30);
}

TEST(Fingers, ABoneNeedsALength) {
  BodyJoints same = joints();
  same.positions["left_ring_finger3"] = same.positions["left_ring_finger2"];
  EXPECT_THAT(support::message_of([&] { make_body_skeleton(same); }),
              ::testing::HasSubstr("left_ring_finger2 and left_ring_finger3 lie at one position"));
}

TEST(Fingers, AHandWithoutFingerPointsIsOneBone) {
  BodyJoints mitten;
  for (const auto& [name, position] : joints().positions)
    if (std::none_of(kFingers.begin(), kFingers.end(),
                     [&](const Finger& finger) { return name.find(finger.point) != std::string::npos; }))
      mitten.positions[name] = position;
  EXPECT_FALSE(has_fingers(mitten, "left_"));
  EXPECT_TRUE(has_fingers(joints(), "left_"));
  const BodySkeleton without = make_body_skeleton(mitten);
  EXPECT_EQ(without.skeleton.num_dofs() + 32, person().num_dofs());
}

}  // namespace
}  // namespace doppel::fingers_test
