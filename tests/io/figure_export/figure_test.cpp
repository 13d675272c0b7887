#include "doppel/io/figure_export/figure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "doppel/rigging/body/body_model.h"
#include "doppel/rigging/body/measures.h"
#include "support/message_of.h"

namespace doppel::figure_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

const Character& person() {
  static const Character kPerson = BodyModel(1500, 100).character("person", mean_measures());
  return kPerson;
}

std::vector<std::string> names_of(const Character& character, BoneNames names) {
  std::vector<std::string> found;
  for (const FigureNode& node : make_figure(character, names).nodes) found.push_back(node.name);
  return found;
}

TEST(Figure, FingersHaveTheNamesThatAreAskedFor) {
  EXPECT_THAT(names_of(person(), BoneNames::skeletool), Contains("LeftHandIndex1"));
  EXPECT_THAT(names_of(person(), BoneNames::vrm),
              AllOf(Contains("leftIndexProximal"), Contains("rightLittleIntermediate"), Contains("leftHand")));
  EXPECT_THAT(names_of(person(), BoneNames::mixamo),
              AllOf(Contains("mixamorig:LeftHandIndex1"), Contains("mixamorig:LeftHand")));
}

TEST(Figure, FingersAreFoundBehindAPrefix) {
  Character imported = person();
  for (Joint& joint : imported.skeleton.joints) joint.name = "Anna:" + joint.name;
  EXPECT_THAT(names_of(imported, BoneNames::vrm), AllOf(Contains("leftIndexProximal"), Contains("leftHand")));
  EXPECT_THAT(names_of(imported, BoneNames::mixamo),
              AllOf(Contains("mixamorig:LeftHandIndex1"), Contains("mixamorig:LeftHand")));
}

/// The names of Unity and Unreal of parts of the body, by those of our body model.
struct Names {
  const char *own, *unity, *unreal;
};
const std::vector<Names> kNames{{"Root", "Hips", "pelvis"},
                                {"Spine", "Spine", "spine_01"},
                                {"Neck", "Neck", "neck_01"},
                                {"Head", "Head", "head"},
                                {"LeftShoulder", "LeftShoulder", "clavicle_l"},
                                {"LeftArm", "LeftUpperArm", "upperarm_l"},
                                {"RightForeArm", "RightLowerArm", "lowerarm_r"},
                                {"RightHand", "RightHand", "hand_r"},
                                {"LeftUpLeg", "LeftUpperLeg", "thigh_l"},
                                {"RightLeg", "RightLowerLeg", "calf_r"},
                                {"LeftFoot", "LeftFoot", "foot_l"},
                                {"RightToeBase", "RightToes", "ball_r"},
                                {"LeftHandThumb1", "LeftThumbProximal", "thumb_01_l"},
                                {"LeftHandThumb2", "LeftThumbIntermediate", "thumb_02_l"},
                                {"RightHandThumb3", "RightThumbDistal", "thumb_03_r"},
                                {"RightHandIndex1", "RightIndexProximal", "index_01_r"},
                                {"LeftHandMiddle2", "LeftMiddleIntermediate", "middle_02_l"},
                                {"LeftHandRing3", "LeftRingDistal", "ring_03_l"},
                                {"RightHandPinky1", "RightLittleProximal", "pinky_01_r"}};

TEST(Figure, UnityAndUnrealFindTheirBones) {
  const auto own = names_of(person(), BoneNames::skeletool), unity = names_of(person(), BoneNames::unity),
             unreal = names_of(person(), BoneNames::unreal);
  for (const Names& names : kNames) {
    const auto at = std::find(own.begin(), own.end(), names.own);
    ASSERT_NE(at, own.end()) << names.own;
    EXPECT_EQ(unity[static_cast<std::size_t>(at - own.begin())], names.unity);
    EXPECT_EQ(unreal[static_cast<std::size_t>(at - own.begin())], names.unreal);
  }
  // The chest is the second bone of the spine.
  EXPECT_THAT(unity, Contains("Chest"));
  EXPECT_THAT(unreal, Contains("spine_02"));
  EXPECT_EQ(renamed_bones(person(), BoneNames::unreal).at("LeftArm"), "upperarm_l");
}

TEST(Figure, NamesStayUnique) {
  for (const BoneNames names : {BoneNames::mixamo, BoneNames::vrm, BoneNames::unity, BoneNames::unreal}) {
    Character named = person();  // a bone of a finger has the name that Unity has for the shin
    for (Joint& joint : named.skeleton.joints)
      if (const std::string from = "LeftHandIndex1"; bone_name(joint.name) == from)
        joint.name = "LeftLowerLeg" + joint.name.substr(from.size());
    std::vector<std::string> found = names_of(named, names);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
  }
}

TEST(Figure, ABodyWithoutBonesThatUnityNeedsIsRefused) {
  Character handless = person();
  for (Joint& joint : handless.skeleton.joints) {
    const std::string bone = bone_name(joint.name);
    if (bone == "LeftHand" || bone == "RightFoot") joint.name.replace(joint.name.find(bone), bone.size(), "Thing");
  }
  EXPECT_THAT(support::message_of([&] { make_figure(handless, BoneNames::unity); }),
              HasSubstr("--names unity needs: LeftHand, RightFoot"));
  EXPECT_THAT(support::message_of([&] { renamed_bones(handless, BoneNames::unreal); }),
              HasSubstr("--names unreal needs: hand_l, foot_r"));
  EXPECT_NO_THROW(make_figure(handless, BoneNames::mixamo));
}

TEST(BoneNames, EachConventionNamesEachPartOnce) {
  for (std::size_t i = 1; i < bone_names_words().size(); ++i) {
    const NameConvention& convention = name_convention(bone_names_of(bone_names_words()[i]));
    std::set<std::string> names;
    for (const auto& [part, name] : convention.names) EXPECT_TRUE(names.insert(name).second) << name;
    for (const std::string& part : body_parts()) EXPECT_EQ(convention.names.count(part), 1U) << part;
    EXPECT_GE(names.size(), 19U + 30U + 3U);
  }
  EXPECT_THAT(support::message_of([] { bone_names_of("maya"); }), HasSubstr("found 'maya', allowed are skeletool, "));
}

}  // namespace
}  // namespace doppel::figure_test
