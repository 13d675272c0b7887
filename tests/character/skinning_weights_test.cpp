#include "doppel/character/skinning_weights.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::skinning_weights_test {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kHead = "Skeletool character skinning file V1.0\nbones:\n   Root Arm\nvertex weights:\n";

class SkinFile : public ::testing::Test {
 protected:
  SkinningWeights read(const std::string& text, int num_vertices = 0) {
    support::write_bytes(path_, text);
    return read_skin(path_, num_vertices);
  }
  std::string refusal(const std::string& text, int num_vertices = 0) {
    return support::message_of<FileError>([&] { read(text, num_vertices); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "a.skin";
};
using SkinReads = SkinFile;
using SkinWrites = SkinFile;
using SkinRejects = SkinFile;

TEST_F(SkinReads, PairsWithDifferentCounts) {
  const SkinningWeights skin = read(kHead + "0 0 0.75 1 0.25\r\n1 1 1.0\r\n", 2);
  EXPECT_THAT(skin.bones, ElementsAre("Root", "Arm"));
  EXPECT_THAT(skin.vertex_bones.offsets, ElementsAre(0, 2, 3));
  EXPECT_THAT(skin.vertex_bones.items, ElementsAre(0, 1, 1));
  EXPECT_THAT(skin.weights, ElementsAre(0.75, 0.25, 1.0));
  EXPECT_FALSE(skin.repaired);
}

TEST_F(SkinReads, RenormalisesAndPutsTheLargestFirst) {
  const SkinningWeights skin = read(kHead + "0 0 0.2501 1 0.7503\n");
  EXPECT_THAT(skin.vertex_bones.items, ElementsAre(1, 0));
  EXPECT_DOUBLE_EQ(skin.weights[0] + skin.weights[1], 1.0);
  EXPECT_NEAR(skin.weights[0], 0.75, 1e-3);
}

TEST_F(SkinReads, VerticesMayComeInAnyOrder) {
  const SkinningWeights skin = read(kHead + "1 1 1.0\n0 0 1.0\n");
  EXPECT_THAT(skin.vertex_bones.items, ElementsAre(0, 1));
}

TEST_F(SkinReads, StripsGluedVertexIndices) {
  // Vertices 0..12; the index stands behind every weight but the last of its line.
  std::string text = kHead;
  for (int v = 0; v < 13; ++v) text += fmt::format("{0} 0 0.541859{0} 1 0.4581408{0} 0 2e-07\n", v);
  const SkinningWeights skin = read(text, 13);
  EXPECT_TRUE(skin.repaired);
  for (int v = 0; v < 13; ++v) {
    EXPECT_NEAR(skin.weights[3 * v], 0.541859, 1e-9) << v;
    EXPECT_NEAR(skin.weights[3 * v + 1], 0.4581408, 1e-9) << v;
  }
}

TEST_F(SkinReads, StripsAGluedIndexFromAnExponentAndFromAWholeNumber) {
  std::string text = kHead + "0 0 1.00 1 0\n";
  for (int v = 1; v < 11; ++v) text += fmt::format("{0} 0 1{0} 1 2.55001e-07{0} 0 0\n", v);
  const SkinningWeights skin = read(text, 11);
  EXPECT_TRUE(skin.repaired);
  EXPECT_NEAR(skin.weights[2 + 9 * 3], 1.0, 1e-6);
  EXPECT_NEAR(skin.weights[3 + 9 * 3], 2.55001e-07, 1e-12);
}

TEST_F(SkinReads, AChanceEndingIsNotGlue) {
  // Both lines could be glued by their look; their sums say that they are not.
  const SkinningWeights skin = read(kHead + "0 0 0.50 1 0.5\n1 0 0.61 1 0.39\n");
  EXPECT_FALSE(skin.repaired);
  EXPECT_THAT(skin.weights, ElementsAre(0.5, 0.5, DoubleEq(0.61), DoubleEq(0.39)));
}

TEST_F(SkinWrites, WhatIsReadBackIsTheSameToTheLastDigit) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const SkinningWeights written = make_test_character(5, 8, 20, seed).skin;
    write_skin(path_, written);
    const SkinningWeights skin = read_skin(path_, written.num_vertices());
    EXPECT_EQ(skin.bones, written.bones);
    EXPECT_EQ(skin.vertex_bones.offsets, written.vertex_bones.offsets);
    EXPECT_EQ(skin.vertex_bones.items, written.vertex_bones.items);
    EXPECT_EQ(skin.weights, written.weights);
    EXPECT_FALSE(skin.repaired);
  }
}

TEST_F(SkinRejects, EachFaultWithItsLineAndReason) {
  EXPECT_THAT(refusal("Skeletool character skinning file V2.0\n"), HasSubstr("skin:1: unsupported version"));
  EXPECT_THAT(refusal("7 3\n0 root\n"), HasSubstr("skin:1: not a skinning file"));
  EXPECT_THAT(refusal(kHead), HasSubstr("0 vertices"));
  EXPECT_THAT(refusal(kHead.substr(0, kHead.find("vertex"))), HasSubstr("ends"));
  EXPECT_THAT(refusal("Skeletool character skinning file V1.0\nbones:\nvertex weights:\n0 0 1\n"), HasSubstr("empty"));
  EXPECT_THAT(refusal("Skeletool character skinning file V1.0\nbones:\nA A\nvertex weights:\n0 0 1\n"),
              HasSubstr("twice"));
  EXPECT_THAT(refusal(kHead + "0 0 1\n1 2 1\n"), HasSubstr("skin:6:"));
  EXPECT_THAT(refusal(kHead + "0 -1 1\n"), HasSubstr("skin:5:"));
  EXPECT_THAT(refusal(kHead + "0 0 1 1\n"), HasSubstr("pairs"));
  EXPECT_THAT(refusal(kHead + "0\n"), HasSubstr("pairs"));
  EXPECT_THAT(refusal(kHead + "0 0 nan\n"), HasSubstr("skin:5:"));
  EXPECT_THAT(refusal(kHead + "0 0 1.5 1 -0.5\n"), HasSubstr("between 0 and 1"));
  EXPECT_THAT(refusal(kHead + "0 0 0.5 1 0.49\n"), HasSubstr("sum to 0.99"));
  EXPECT_EQ(refusal(kHead + "0 0 0.333 1 0.665\n"), "nothing was thrown");  // rounded to three decimals
  EXPECT_THAT(refusal(kHead + "0 0 1\n0 1 1\n"), HasSubstr("second line"));
  EXPECT_THAT(refusal(kHead + "0 0 1\n2 1 1\n"), HasSubstr("vertex 1 has no line"));
  EXPECT_THAT(refusal(kHead + "0 0 1\n1 1 1\n", 3), HasSubstr("2 vertices"));
  EXPECT_THAT(refusal(kHead + "0 0 1\n1 1 1\n", 1), HasSubstr("has 1 vertices"));
  EXPECT_THAT(refusal(kHead + "99999999999 0 1\n"), HasSubstr("skin:5:"));
}

}  // namespace
}  // namespace doppel::skinning_weights_test
