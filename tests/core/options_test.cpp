#include "doppel/core/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/config.h"
#include "support/message_of.h"

namespace doppel::options_test {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

enum class Fit { stretch, letterbox };

struct Round {
  std::int64_t steps = 10;
};
void describe_keys(const Keys& keys, Round& round) {
  keys("steps", round.steps, at_least<std::int64_t>(1), "of the round");
}

struct Inner {
  double length = 2.0;  // metres
  bool on = true;
};
void describe_keys(const Keys& keys, Inner& inner) {
  keys("length", inner.length, between(0.0, 1e6), "of the arm, millimetres", [](double mm) { return 1e-3 * mm; });
  keys("on", inner.on, "draw the arm");
}

struct Outer {
  int count = 3;
  Fit fit = Fit::letterbox;
  bool best = false;
  std::vector<int> sizes{3, 5};
  std::vector<std::string> names;
  std::filesystem::path weights;
  Inner inner;
  std::vector<Round> rounds{{1}, {2}};
};
void describe_keys(const Keys& keys, Outer& outer) {
  keys("count", outer.count, between(1, 9), "of people");
  keys.require("count", outer.count % 2 == 1, "must be odd");
  keys("image.fit", outer.fit, {"stretch", "letterbox"}, "of images");
  keys("keep", outer.best, {"last", "best"}, "checkpoint");
  keys("image.sizes", outer.sizes, "of kernels");
  keys("names", outer.names, "of cameras");
  keys("weights", outer.weights, "of the network");
  describe_keys(keys.section("inner"), outer.inner);
  keys.items("rounds", outer.rounds, "one after the other");
  keys.forbid("steps", "`rounds` states the steps");
}

namespace {

Outer read(const std::string& text) {
  const ConfigDocument document = ConfigDocument::parse(text, "/tmp/c.yaml");
  const ConfigReader root = document.root();
  const Outer outer = read_options<Outer>(root);
  root.finish();
  return outer;
}

TEST(OptionsReference, MissingKeysKeepTheDefaults) {
  const Outer outer = read("{}");
  EXPECT_EQ(outer.count, 3);
  EXPECT_EQ(outer.fit, Fit::letterbox);
  EXPECT_FALSE(outer.best);
  EXPECT_EQ(outer.sizes, (std::vector<int>{3, 5}));
  EXPECT_EQ(outer.inner.length, 2.0);
  ASSERT_EQ(outer.rounds.size(), 2u);
  EXPECT_EQ(outer.rounds[1].steps, 2);
}

TEST(OptionsReference, ReadsEveryKindOfKey) {
  const Outer outer = read(
      "{count: 5, keep: best, image: {fit: stretch, sizes: [7]}, names: [a, b], weights: w.pth, "
      "inner: {length: 500, on: false}, rounds: [{}, {steps: 4}, {}]}");
  EXPECT_EQ(outer.count, 5);
  EXPECT_EQ(outer.fit, Fit::stretch);
  EXPECT_TRUE(outer.best);
  EXPECT_EQ(outer.sizes, std::vector<int>{7});
  EXPECT_EQ(outer.names, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(outer.weights, "/tmp/w.pth");
  EXPECT_EQ(outer.inner.length, 0.5);
  EXPECT_FALSE(outer.inner.on);
  ASSERT_EQ(outer.rounds.size(), 3u);
  EXPECT_EQ(outer.rounds[0].steps, 10);
  EXPECT_EQ(outer.rounds[1].steps, 4);
}

TEST(OptionsReference, AnEmptyListIsNoMissingKey) { EXPECT_TRUE(read("rounds: []").rounds.empty()); }

TEST(OptionsReference, TheDocumentKnowsTheValuesInItsOwnUnit) {
  const ConfigDocument document = ConfigDocument::parse("inner: {on: false}\n", "c.yaml");
  read_options<Outer>(document.root());
  EXPECT_EQ(document.values().at("inner.length"), "2000");
  EXPECT_EQ(document.values().at("inner.on"), "false");
  EXPECT_EQ(document.values().at("image.sizes"), "[3, 5]");
  EXPECT_EQ(document.values().at("image.fit"), "letterbox");
  EXPECT_EQ(document.resolved(), "inner: {on: false}\n");
}

TEST(OptionsReject, WithFileLineAndKey) {
  const auto message = [](const std::string& text) { return message_of<FileError>([&] { read(text); }); };
  EXPECT_THAT(message("\ninner: {length: -1}\n"),
              AllOf(HasSubstr("c.yaml:2"), HasSubstr("inner.length: found -1, allowed is between 0 and 1000000")));
  EXPECT_THAT(message("count: 4\n"), HasSubstr("count: must be odd"));
  EXPECT_THAT(message("image: {fit: strech}\n"), HasSubstr("did you mean stretch?"));
  EXPECT_THAT(message("inner: {lenght: 1}\n"), HasSubstr("did you mean length?"));
  EXPECT_THAT(message("rounds: [{}, {steps: 0}]\n"), HasSubstr("rounds[1].steps: found 0"));
  EXPECT_THAT(message("steps: 3\n"), HasSubstr("`rounds` states the steps"));
}

TEST(OptionsReference, MakesTheTableOfTheDocs) {
  EXPECT_EQ(key_table(key_rows<Outer>()),
            "| key | default | allowed | meaning |\n|---|---|---|---|\n"
            "| `count` | 3 | 1 to 9 | of people |\n"
            "| `image.fit` | letterbox | stretch, letterbox | of images |\n"
            "| `keep` | last | last, best | checkpoint |\n"
            "| `image.sizes` | `[3, 5]` | a list of integers | of kernels |\n"
            "| `names` | `[]` | a list of words | of cameras |\n"
            "| `weights` | | a path | of the network |\n"
            "| `inner.length` | 2000 | 0 to 1000000 | of the arm, millimetres |\n"
            "| `inner.on` | true | true, false | draw the arm |\n"
            "| `rounds` | | a list of mappings | one after the other |\n"
            "| `rounds[].steps` | 10 | 1 or more | of the round |\n");
}

}  // namespace
}  // namespace doppel::options_test
