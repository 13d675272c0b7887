#include "doppel/data/keypoints.h"

#include <gtest/gtest.h>

#include <fstream>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

namespace doppel {
namespace {

std::string person(int points, double confidence) {
  std::string text = "{\"person_id\":[-1],\"pose_keypoints_2d\":[";
  for (int i = 0; i < points; ++i)
    text += (i ? "," : "") + std::to_string(10 + i) + ".5," + std::to_string(i) + "," + std::to_string(confidence);
  return text + "]}";
}

std::string document(const std::string& people) { return "{\"version\":1.3,\n\"people\":[" + people + "]}\n"; }

class KeypointFile {
 public:
  explicit KeypointFile(const std::string& text) { std::ofstream(path()) << text; }
  std::filesystem::path path() const { return folder_ / "f_keypoints.json"; }

 private:
  support::TemporaryFolder folder_;
};

TEST(KeypointsReference, TakesTheMostConfidentPerson) {
  const KeypointFile file(document(person(25, 0.2) + "," + person(25, 0.9) + "," + person(25, 0.5)));
  const std::vector<Keypoint> points = read_openpose(file.path());
  ASSERT_EQ(points.size(), 25u);
  EXPECT_FLOAT_EQ(points[3].x, 13.5f);
  EXPECT_FLOAT_EQ(points[3].y, 3.0f);
  EXPECT_FLOAT_EQ(points[3].confidence, 0.9f);
}

TEST(KeypointsReference, NobodySeenMeansNoConfidence) {
  const std::vector<Keypoint> points = read_openpose(KeypointFile(document("")).path(), 18);
  ASSERT_EQ(points.size(), 18u);
  for (const Keypoint& point : points) EXPECT_EQ(point.confidence, 0.0f);
}

TEST(KeypointsReference, ReadsCoco) {
  EXPECT_EQ(read_openpose(KeypointFile(document(person(18, 0.5))).path(), 18).size(), 18u);
  EXPECT_EQ(read_openpose(KeypointFile(document(person(18, 0.5))).path(), 0).size(), 18u);
}

TEST(KeypointsRejects, WhatIsNoKeypointFile) {
  for (const std::string& text : {std::string("[]"), std::string("{}"), std::string("{\"people\":3}"), document("3"),
                                  document("{}"), document("{\"pose_keypoints_2d\":[1,2]}"), document(person(24, 1.0)),
                                  document("{\"pose_keypoints_2d\":[1,2,\"x\"]}"), std::string("{\"people\":[")})
    EXPECT_THROW(read_openpose(KeypointFile(text).path()), Error) << text;
}

TEST(KeypointsRejects, HostileFiles) {
  const KeypointFile file("");
  support::expect_survives_hostile_files(
      file.path(), document(person(25, 0.7)), [](const std::filesystem::path& path) { read_openpose(path); }, 30);
}

}  // namespace
}  // namespace doppel
