#include "doppel/io/figure_export/figure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/rigging/body/body_model.h"
#include "doppel/rigging/body/measures.h"

namespace doppel::figure_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;

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

}  // namespace
}  // namespace doppel::figure_test
