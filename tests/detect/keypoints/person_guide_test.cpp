#include "doppel/detect/keypoints/person_guide.h"

#include <gtest/gtest.h>

namespace doppel::person_guide_test {
namespace {

using Eigen::Vector2d;

PersonAnchor seen(double x) { return {{x, 200}, 40, true}; }
PersonAnchor hidden() { return {{0, 0}, 0, false}; }

TEST(PersonGuide, MovesInALineBetweenAnchors) {
  const PersonGuide guide({{10, seen(100)}, {20, seen(200)}}, 10);
  EXPECT_EQ(guide.start(), Vector2d(100, 200));
  EXPECT_EQ(guide.at(10)->radius, 40) << "exactly known";
  EXPECT_EQ(guide.at(13)->hips, Vector2d(130, 200));
  EXPECT_GT(guide.at(15)->radius, guide.at(13)->radius) << "less is known far from the anchors";
  EXPECT_DOUBLE_EQ(guide.at(13)->radius, guide.at(17)->radius);
}

TEST(PersonGuide, KnowsNothingFarFromAnchors) {
  const PersonGuide guide({{10, seen(100)}, {60, seen(200)}}, 10);
  EXPECT_EQ(guide.at(4)->hips, Vector2d(100, 200));
  EXPECT_EQ(guide.at(66)->hips, Vector2d(200, 200));
  EXPECT_TRUE(guide.at(20));
  for (const long frame : {-1L, 35L, 71L}) EXPECT_FALSE(guide.at(frame)) << frame;
  EXPECT_FALSE(PersonGuide().at(0));
  EXPECT_FALSE(PersonGuide().start());
  EXPECT_EQ(PersonGuide(Vector2d(3, 4)).start(), Vector2d(3, 4));
  EXPECT_FALSE(PersonGuide(Vector2d(3, 4)).at(0)) << "a start is no anchor";
}

TEST(PersonGuide, NobodyIsFollowedWhileThePersonIsAway) {
  const PersonGuide guide({{0, seen(100)}, {10, hidden()}, {20, hidden()}, {30, seen(300)}}, 10);
  for (const long frame : {10L, 15L, 20L}) EXPECT_FALSE(guide.at(frame)->visible) << frame;
  EXPECT_EQ(guide.at(8)->hips, Vector2d(100, 200)) << "near the position where the person was last";
  EXPECT_TRUE(guide.at(8)->visible);
  EXPECT_EQ(guide.at(22)->hips, Vector2d(300, 200)) << "near the position where the person will be";
  EXPECT_GT(guide.at(22)->radius, 2 * guide.at(30)->radius);
  const PersonGuide leaving({{0, seen(100)}, {10, PersonAnchor{{200, 200}, 40, false}}}, 10);
  EXPECT_EQ(leaving.at(4)->hips, Vector2d(140, 200)) << "it is known where the person went";
  EXPECT_TRUE(leaving.at(4)->visible);
  EXPECT_FALSE(leaving.at(10)->visible);
  EXPECT_EQ(PersonGuide({{0, hidden()}, {10, seen(100)}}, 10).start(), Vector2d(100, 200));
}

}  // namespace
}  // namespace doppel::person_guide_test
