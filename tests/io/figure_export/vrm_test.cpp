#include "doppel/io/figure_export/vrm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/message_of.h"

namespace doppel::vrm_test {
namespace {

const std::vector<std::string> kBones{"root",          "hips",         "spine",        "chest",         "head",
                                      "leftUpperLeg",  "leftLowerLeg", "leftFoot",     "rightUpperLeg", "rightLowerLeg",
                                      "rightFoot",     "leftUpperArm", "leftLowerArm", "leftHand",      "rightUpperArm",
                                      "rightLowerArm", "rightHand",    "LeftHandThumb"};

Figure figure_of(const std::vector<std::string>& names) {
  Figure figure;
  for (const std::string& name : names)
    figure.nodes.push_back({name, static_cast<int>(figure.nodes.size()) - 1, static_cast<int>(figure.nodes.size())});
  return figure;
}

TEST(Vrm, NamesBonesAndAuthors) {
  const tinygltf::Value vrm = vrm_extension(figure_of(kBones), "anna", {{"Anna", "Ben"}, "https://example.org/l"}, 5);
  EXPECT_EQ(vrm.Get("specVersion").Get<std::string>(), "1.0");
  const tinygltf::Value& meta = vrm.Get("meta");
  EXPECT_EQ(meta.Get("name").Get<std::string>(), "anna");
  EXPECT_EQ(meta.Get("authors").Get(1).Get<std::string>(), "Ben");
  EXPECT_EQ(meta.Get("licenseUrl").Get<std::string>(), "https://vrm.dev/licenses/1.0/");
  EXPECT_EQ(meta.Get("otherLicenseUrl").Get<std::string>(), "https://example.org/l");
  const tinygltf::Value& bones = vrm.Get("humanoid").Get("humanBones");
  ASSERT_TRUE(bones.IsObject());
  EXPECT_EQ(bones.Keys().size(), 16U);
  for (std::size_t i = 1; i + 1 < kBones.size(); ++i)
    EXPECT_EQ(bones.Get(kBones[i]).Get("node").GetNumberAsInt(), 5 + static_cast<int>(i)) << kBones[i];
}

TEST(Vrm, SaysWhichBonesAreMissing) {
  std::vector<std::string> names = kBones;
  names[4] = "skull";
  names[13] = "paw";
  EXPECT_THAT(support::message_of([&] {
                vrm_extension(figure_of(names), "anna", {{"Anna"}, ""}, 1);
              }),
              ::testing::HasSubstr("requires: head, leftHand;"));
  EXPECT_THAT(support::message_of([&] { vrm_extension(figure_of(kBones), "anna", {}, 1); }),
              ::testing::HasSubstr("--author NAME"));
}

}  // namespace
}  // namespace doppel::vrm_test
