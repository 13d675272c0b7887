#include "doppel/character/rigidity.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::rigidity_test {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(RigidityReference, ThreeTablesForTheSameLabels) {
  // background, hair, upper clothes, socks, pants, scarf, arm, shoe, what lies under a dress
  const std::vector<int> labels{0, 2, 5, 8, 9, 11, 14, 18, 20};
  const auto of = [&](RigidityPreset preset) { return vertex_rigidity(labels, 9, preset); };
  EXPECT_THAT(of(RigidityPreset::livecap), ElementsAre(1, 200, 2, 50, 2.5, 3, 50, 100, 1));
  EXPECT_THAT(of(RigidityPreset::graph), ElementsAre(10, 200, 10, 50, 15, 50, 200, 200, 10));
  EXPECT_THAT(of(RigidityPreset::laplacian), ElementsAre(1, 400, 1, 1, 2, 1, 5, 5, 0.25));
}

TEST(RigidityReference, OneEverywhereWithoutLabels) {
  EXPECT_THAT(vertex_rigidity({}, 3, RigidityPreset::graph), ElementsAre(1, 1, 1));
}

TEST(RigidityReference, RefinementSoftensClothesOfTheGraphTableOnly) {
  const std::vector<int> labels{5, 9, 8, 14};
  EXPECT_THAT(vertex_rigidity(labels, 4, RigidityPreset::graph, true),
              ElementsAre(DoubleEq(1), DoubleEq(1.5), DoubleEq(50), DoubleEq(200)));
  EXPECT_THAT(vertex_rigidity(labels, 4, RigidityPreset::livecap, true), ElementsAre(2, 2.5, 50, 50));
}

TEST(RigidityReference, ANodeTakesThePlainMeanOfWhatItInfluences) {
  EmbeddedGraph graph;
  graph.node_vertex = {0, 2};
  graph.vertex_nodes.offsets = {0, 1, 3, 4};
  graph.vertex_nodes.items = {0, 0, 1, 1};
  graph.weights = {1.0, 0.9, 0.1, 1.0};
  EXPECT_THAT(node_rigidity({1.0, 3.0, 10.0}, graph), ElementsAre(2.0, 6.5));
  EXPECT_THROW(node_rigidity({1.0}, graph), Error);
}

TEST(RigidityRejects, WrongLabelsCountsAndWords) {
  EXPECT_THROW(vertex_rigidity({1, 2}, 3, RigidityPreset::graph), Error);
  EXPECT_THROW(vertex_rigidity({21}, 1, RigidityPreset::graph), Error);
  EXPECT_EQ(parse_rigidity_preset("livecap"), RigidityPreset::livecap);
  EXPECT_EQ(parse_rigidity_preset("graph"), RigidityPreset::graph);
  EXPECT_EQ(parse_rigidity_preset("laplacian"), RigidityPreset::laplacian);
  EXPECT_THROW(parse_rigidity_preset("stiff"), UsageError);
}

class Segmentation : public ::testing::Test {
 protected:
  std::string refusal(const std::string& text, int num_vertices) {
    support::write_bytes(path_, text);
    return support::message_of<FileError>([&] { read_segmentation(path_, num_vertices); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "segmentation.txt";
};
using SegmentationReads = Segmentation;
using SegmentationRejects = Segmentation;

TEST_F(SegmentationReads, WhatWasWrittenAndWindowsLineEnds) {
  write_segmentation(path_, {0, 20, 5});
  EXPECT_THAT(read_segmentation(path_, 3), ElementsAre(0, 20, 5));
  support::write_bytes(path_, "7\r\n8\r\n");
  EXPECT_THAT(read_segmentation(path_, 2), ElementsAre(7, 8));
}

TEST_F(SegmentationRejects, EachFaultWithItsLineAndReason) {
  EXPECT_THAT(refusal("1\n2\n", 3), HasSubstr("2 labels, but the mesh has 3 vertices"));
  EXPECT_THAT(refusal("1\n2\n", 1), HasSubstr("2 labels, but the mesh has 1 vertices"));
  EXPECT_THAT(refusal("1\n21\n", 2), HasSubstr("txt:2:"));
  EXPECT_THAT(refusal("1\n-1\n", 2), HasSubstr("txt:2:"));
  EXPECT_THAT(refusal("1\n2.5\n", 2), HasSubstr("txt:2:"));
  EXPECT_THAT(refusal("1 2\n", 2), HasSubstr("txt:1: a line holds one label"));
}

}  // namespace
}  // namespace doppel::rigidity_test
