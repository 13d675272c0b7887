#include "detect_people.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::tools::detect_people_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Words = std::vector<std::string>;

DetectSource camera(const std::string& name, long first, long last, FrameClock clock = {},
                    const std::string& sequence = "walk") {
  DetectSource source;
  source.sequence = sequence;
  source.camera = name;
  for (long frame = first; frame <= last; ++frame) source.frames.push_back(frame);
  source.calibration.emplace();
  source.clock = clock;
  return source;
}

TEST(PersonWish, IsReadByTheNumberOfWords) {
  const std::vector<DetectSource> one{camera("front", 0, 9)}, two{camera("front", 0, 9), camera("2", 0, 9)};
  EXPECT_FALSE(read_person_wish({}, two, "anna").names_person());
  EXPECT_EQ(read_person_wish({"560", "520.5"}, one, "anna").pixel, Eigen::Vector2d(560, 520.5));
  EXPECT_EQ(read_person_wish({"front", "560", "520"}, one, "anna").pixel, Eigen::Vector2d(560, 520));
  const PersonWish pixel = read_person_wish({"2", "560", "520"}, two, "anna");
  EXPECT_EQ(pixel.camera, "2") << "the name of a camera, though it is a number";
  EXPECT_EQ(pixel.pixel, Eigen::Vector2d(560, 520));
  const PersonWish position = read_person_wish({"2.0", "1", "-0.5"}, two, "anna");
  EXPECT_EQ(position.near, Eigen::Vector3d(2, 1, -0.5));
  EXPECT_FALSE(position.pixel);
}

TEST(PersonWish, SaysWhatIsAllowed) {
  const std::vector<DetectSource> one{camera("front", 0, 9)}, two{camera("front", 0, 9), camera("side", 0, 9)};
  for (const Words& words : {Words{"560", "520"},
                             {"back", "560", "520"},
                             {"front", "560"},
                             {"front", "5", "x"},
                             {"front", "nan", "3"},
                             {"1", "2", "inf"},
                             {"1"},
                             {"side", "1", "2", "3"}})
    EXPECT_THAT(message_of<UsageError>([&] { read_person_wish(words, two, "anna"); }),
                AllOf(HasSubstr("anna"), HasSubstr("CAMERA X Y"), HasSubstr("front, side"), HasSubstr("X Y Z")));
  for (const Words& words : {Words{"1", "2", "3"}, {"1", "x"}, {"1"}})
    EXPECT_THAT(message_of<UsageError>([&] { read_person_wish(words, one, "anna"); }),
                AllOf(HasSubstr("one camera"), HasSubstr("X Y")));
}

TEST(PeopleSearch, LooksAtMomentsThatAllCamerasHaveFilmed) {
  const std::vector<DetectSource> sources{camera("a", 0, 999), camera("b", 30, 1029, {1.0, 40.0}),
                                          camera("c", 0, 1999, {2.0, 0.0})};
  const std::vector<PeopleSearch> searches = plan_searches(sources);
  ASSERT_EQ(searches.size(), 1u);
  EXPECT_EQ(searches[0].sequence, "walk");
  EXPECT_THAT(searches[0].sources, ElementsAre(0, 1, 2));
  EXPECT_EQ(searches[0].step, 15);
  EXPECT_EQ(searches[0].rows.front(), 0);
  EXPECT_EQ(searches[0].rows.size(), 66u) << "rows 0 to 989, which the second camera films to its end";
  for (const DetectSource& source : sources)
    for (const long row : searches[0].rows) {
      EXPECT_GE(source.clock.frame(row), source.frames.front());
      EXPECT_LE(source.clock.frame(row), source.frames.back());
    }
}

TEST(PeopleSearch, LooksMoreOftenInShortSequences) {
  const auto search = [](long frames) {
    return plan_searches(std::vector<DetectSource>{camera("a", 0, frames - 1), camera("b", 0, frames - 1)}).at(0);
  };
  EXPECT_EQ(search(100).step, 12);
  EXPECT_GE(search(100).rows.size(), 8u);
  EXPECT_EQ(search(5).rows.size(), 5u);
  EXPECT_EQ(search(1).rows.size(), 1u);
}

TEST(PeopleSearch, NeedsSeveralCamerasAtTheSameTime) {
  DetectSource film = camera("a", 0, 9);
  film.calibration.reset();
  EXPECT_TRUE(plan_searches(std::vector<DetectSource>{film}).empty());
  EXPECT_TRUE(plan_searches(std::vector<DetectSource>{camera("a", 0, 9), camera("a", 0, 9, {}, "run")}).empty());
  EXPECT_TRUE(plan_searches(std::vector<DetectSource>{camera("a", 0, 9), camera("b", 0, 9, {1.0, -20.0})}).empty());
}

}  // namespace
}  // namespace doppel::tools::detect_people_test
