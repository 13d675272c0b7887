#include "doppel/core/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::config_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kText =
    "# a comment\n"
    "name: egnet\n"
    "train:\n"
    "  batch_size: 40\n"
    "  learning_rate: 1e-4\n"
    "  shuffle: true\n"
    "  schedule: [100, 200, 300]\n"
    "  milestone: 7\n"
    "stages:\n"
    "  - kind: warm\n"
    "    steps: 10\n"
    "  - kind: full\n"
    "    steps: 20\n";

ConfigDocument document(const std::vector<std::string>& overrides = {}) {
  return ConfigDocument::parse(kText, "egnet.yaml", overrides);
}

TEST(ConfigReference, ReadsEveryType) {
  const ConfigReader root = document().root();
  EXPECT_EQ(root.get<std::string>("name"), "egnet");
  const ConfigReader train = root.section("train");
  EXPECT_EQ(train.get<int>("batch_size"), 40);
  EXPECT_EQ(train.get<long>("batch_size"), 40);
  EXPECT_EQ(train.get<double>("batch_size"), 40.0);
  EXPECT_EQ(train.get<double>("learning_rate"), 1e-4);
  EXPECT_TRUE(train.get<bool>("shuffle"));
  EXPECT_THAT(train.list<int>("schedule"), ElementsAre(100, 200, 300));
  EXPECT_THAT(train.list<int>("milestone"), ElementsAre(7));
  EXPECT_THAT(train.list<double>("absent"), IsEmpty());
  const std::vector<ConfigReader> stages = root.sections("stages");
  ASSERT_EQ(stages.size(), 2u);
  EXPECT_EQ(stages[1].choice("kind", {"warm", "full"}), "full");
  EXPECT_THAT(root.keys(), ElementsAre("name", "train", "stages"));
}

TEST(ConfigReference, MissingKeysTakeTheirDefaults) {
  const ConfigReader root = ConfigDocument::parse("", "empty.yaml").root();
  EXPECT_EQ(root.section("train").get("batch_size", 12, at_least(1)), 12);
  EXPECT_EQ(root.get("name", "none"), "none");
  EXPECT_EQ(root.choice("kind", {"a", "b"}, "b"), "b");
  EXPECT_THAT(root.sections("stages"), IsEmpty());
  EXPECT_NO_THROW(root.finish());
}

TEST(ConfigReference, RemembersTheValueOfEveryKeyThatWasRead) {
  const ConfigDocument text = document();
  const ConfigReader root = text.root(), train = root.section("train");
  EXPECT_TRUE(text.values().empty());
  train.get("batch_size", 7);
  train.get("decay", 0.25);
  train.choice("kind", {"slow", "fast"}, "slow");
  train.list<int>("schedule");
  root.sections("stages")[1].get<int>("steps");
  EXPECT_FALSE(root.has("absent"));
  EXPECT_EQ(text.values(), (std::map<std::string, std::string>{{"train.batch_size", "40"},
                                                               {"train.decay", "0.25"},
                                                               {"train.kind", "slow"},
                                                               {"train.schedule", "[100, 200, 300]"},
                                                               {"stages[1].steps", "20"}}));
}

TEST(ConfigReference, OverridesComeLastAndShowInTheResolvedText) {
  const ConfigDocument changed =
      document({"train.batch_size=4", "train.batch_size=8", "extra.deep.key=[1, 2]", "stages.1.steps=99", "name=a=b"});
  const auto check = [](const ConfigReader& root) {
    EXPECT_EQ(root.section("train").get<int>("batch_size"), 8);
    EXPECT_THAT(root.section("extra").section("deep").list<int>("key"), ElementsAre(1, 2));
    EXPECT_EQ(root.sections("stages")[1].get<int>("steps"), 99);
    EXPECT_EQ(root.get<std::string>("name"), "a=b");
  };
  check(changed.root());
  check(ConfigDocument::parse(changed.resolved(), "again.yaml").root());
}

TEST(ConfigReference, OverridesKeepTextsOfAnyCharacters) {
  EXPECT_EQ(text_override("capture", "/a/b c"), "capture=/a/b c");
  for (const std::string text : {"/a #1/b", "a: b", "[x]", "{y}", "*z", "say \"x\"", "5", " blank ", "~"}) {
    const ConfigDocument changed = ConfigDocument::parse("a: 1\n", "c.yaml", {text_override("name", text)});
    EXPECT_EQ(changed.root().get<std::string>("name"), text);
    const std::string quoted = text_override("name", text);
    if (text != "5") EXPECT_EQ(text_of_override(quoted.substr(quoted.find('=') + 1)), text);
  }
  const ConfigDocument typed = ConfigDocument::parse("a: 1\n", "c.yaml", {"name=/a #1/b"});
  EXPECT_EQ(typed.root().get<std::string>("name"), "/a #1/b") << "a number sign begins no comment";
}

TEST(ConfigReference, PathsStartWhereTheyWereWritten) {
  const ConfigDocument changed =
      ConfigDocument::parse("a: x/y.obj\nb: /abs/z\nc: old\n", "/home/of/config.yaml", {"c=typed"});
  const ConfigReader root = changed.root();
  EXPECT_EQ(root.path("a"), "/home/of/x/y.obj");
  EXPECT_EQ(root.path("b"), "/abs/z");
  EXPECT_EQ(root.path("c"), std::filesystem::current_path() / "typed");
  EXPECT_EQ(root.path("d", "w"), "/home/of/w");
  // The resolved text moves into a run folder, so its paths may not depend on where it lies.
  EXPECT_EQ(ConfigDocument::parse(changed.resolved(), "/else/where.yaml").root().path("a"), "/home/of/x/y.obj");
}

TEST(ConfigRejects, WrongTypesAndRangesNameEverything) {
  const ConfigReader train = document().root().section("train");
  EXPECT_THAT(message_of<Error>([&] { train.get<int>("shuffle"); }),
              AllOf(StartsWith("egnet.yaml:6: train.shuffle"), HasSubstr("\"true\""), HasSubstr("an integer")));
  EXPECT_THAT(message_of<Error>([&] { train.get<int>("learning_rate"); }), HasSubstr("an integer"));
  EXPECT_THAT(message_of<Error>([&] { train.get<double>("schedule"); }), HasSubstr("a list of 3"));
  EXPECT_THAT(message_of<Error>([&] { train.get("batch_size", 1, between(1, 32)); }),
              AllOf(StartsWith("egnet.yaml:4: train.batch_size"), HasSubstr("40"), HasSubstr("between 1 and 32")));
  EXPECT_THAT(message_of<Error>([&] { train.get<double>("absent"); }),
              AllOf(HasSubstr("train.absent"), HasSubstr("missing")));
  EXPECT_THAT(message_of<Error>([&] { document().root().section("name"); }), HasSubstr("a mapping"));
  EXPECT_THAT(message_of<Error>([&] { document().root().sections("train"); }), HasSubstr("a list of mappings"));
  EXPECT_THAT(message_of<Error>([&] {
                document().root().sections("stages")[0].choice("kind", {"worm", "full"});
              }),
              AllOf(HasSubstr("stages[0].kind"), HasSubstr("did you mean worm?")));
}

TEST(ConfigRejects, NumbersThatAreNone) {
  for (const char* value : {".nan", ".inf", "1.5x", "\"3\"", "", "~", "0x", "1e999"}) {
    const ConfigDocument bad = ConfigDocument::parse(std::string("v: ") + value, "v.yaml");
    EXPECT_THROW(bad.root().get<double>("v"), FileError) << value;
    EXPECT_THROW(bad.root().get<int>("v"), FileError) << value;
  }
  EXPECT_THROW(ConfigDocument::parse("v: 3000000000", "v.yaml").root().get<int>("v"), FileError);
  EXPECT_EQ(ConfigDocument::parse("v: 3000000000", "v.yaml").root().get<long>("v"), 3000000000L);
}

TEST(ConfigRejects, UnknownKeysNamingTheNearest) {
  const ConfigDocument slip = ConfigDocument::parse("train:\n  bacth_size: 3\n", "slip.yaml");
  const ConfigReader root = slip.root();
  root.section("train").get("batch_size", 40);
  EXPECT_THAT(message_of<Error>([&] { root.finish(); }),
              AllOf(StartsWith("slip.yaml:2: train.bacth_size"), HasSubstr("did you mean batch_size?")));

  const ConfigReader untouched = document().root();
  untouched.get<std::string>("name");
  EXPECT_THAT(message_of<Error>([&] { untouched.finish(); }),
              AllOf(StartsWith("egnet.yaml:"), HasSubstr("known are name")));
}

TEST(ConfigRejects, UnknownKeysInItemsOfAList) {
  const ConfigReader root = document().root();
  for (const ConfigReader& stage : root.sections("stages")) stage.get<int>("steps");
  EXPECT_THAT(message_of<Error>([&] { root.sections("stages")[0].finish(); }), HasSubstr("stages[0].kind"));
}

TEST(ConfigReference, APartIsADocumentOfItsOwn) {
  const ConfigDocument whole =
      ConfigDocument::parse("capture: x\nseed: 7\nfirst:\n  rate: 0.5\n  list: [1, 2]\nsecond: {rate: 2}\n",
                            "chain.yaml", {"first.rate=0.25"});
  const ConfigDocument part = whole.part("first", {"capture", "seed", "absent"});
  const ConfigReader root = part.root();
  EXPECT_EQ(root.get<std::string>("capture"), "x");
  EXPECT_EQ(root.get<int>("seed"), 7);
  EXPECT_EQ(root.get<double>("rate"), 0.25);
  EXPECT_THAT(root.list<int>("list"), ElementsAre(1, 2));
  root.finish();
  const ConfigReader again = ConfigDocument::parse(part.resolved(), "resolved.yaml").root();
  EXPECT_EQ(again.get<double>("rate"), 0.25);
  EXPECT_FALSE(again.has("second"));
  EXPECT_FALSE(whole.part("third", {"seed"}).root().has("rate"));
}

TEST(ConfigRejects, MistakesInAPartWithTheLineOfTheWhole) {
  const ConfigDocument whole =
      ConfigDocument::parse("seed: 7\nfirst:\n  rate: fast\nsecond:\n  seed: 1\n", "chain.yaml", {"first.size=big"});
  const ConfigDocument part = whole.part("first", {"seed"});
  EXPECT_THAT(message_of([&] { part.root().get<double>("rate"); }), HasSubstr("chain.yaml:3"));
  EXPECT_THAT(message_of([&] { part.root().get<double>("size"); }), HasSubstr("--set first.size=big"));
  EXPECT_THAT(message_of([&] { whole.part("second", {"seed"}); }),
              AllOf(HasSubstr("chain.yaml:5"), HasSubstr("top level of the file")));
}

TEST(ConfigRejects, TheSameKeyTwice) {
  const ConfigReader root = ConfigDocument::parse("a: 1\nb: 2\na: 3\n", "twice.yaml").root();
  root.get<int>("a");
  root.get<int>("b");
  EXPECT_THAT(message_of<Error>([&] { root.finish(); }), AllOf(StartsWith("twice.yaml:3"), HasSubstr("twice")));
}

TEST(ConfigRejects, BadOverrides) {
  EXPECT_THROW(document({"train.batch_size"}), UsageError);
  EXPECT_THROW(document({"=3"}), UsageError);
  EXPECT_THROW(document({"train..batch_size=3"}), UsageError);
  EXPECT_THROW(document({"name.inner=3"}), UsageError);
  EXPECT_THROW(document({"stages.7.steps=3"}), UsageError);
  EXPECT_THROW(document({"name=[1"}), UsageError);
  const ConfigDocument changed = document({"train.batch_size=many"});
  EXPECT_THAT(message_of<Error>([&] { changed.root().section("train").get<int>("batch_size"); }),
              StartsWith("--set train.batch_size=many: train.batch_size"));
}

TEST(ConfigRejects, HostileFiles) {
  const TemporaryFolder folder;
  // An empty configuration means all defaults, so the reader under test asks for a key.
  support::expect_survives_hostile_files(folder / "hostile.yaml", kText, [](const std::filesystem::path& path) {
    const ConfigReader root = ConfigDocument::load(path).root();
    root.get<std::string>("name");
    const ConfigReader train = root.section("train");
    train.get<int>("batch_size", at_least(1));
    train.get<double>("learning_rate");
    train.get<bool>("shuffle");
    train.list<int>("schedule");
    train.get<int>("milestone");
    for (const ConfigReader& stage : root.sections("stages")) {
      stage.choice("kind", {"warm", "full"});
      stage.get<int>("steps", at_least(0));
    }
    root.finish();
  });
}

TEST(ConfigRejects, DeepNesting) {
  EXPECT_THROW(ConfigDocument::parse("a: " + std::string(100000, '['), "deep.yaml"), FileError);
}

TEST(NearestWord, FindsSlipsAndLeavesStrangersAlone) {
  EXPECT_EQ(nearest_word("learning_rat", {"batch_size", "learning_rate"}), "learning_rate");
  EXPECT_EQ(nearest_word("cmaera", {"camera", "capture"}), "camera");
  EXPECT_EQ(nearest_word("zebra", {"camera", "capture"}), std::nullopt);
  EXPECT_EQ(nearest_word("x", {"y"}), std::nullopt);
  EXPECT_EQ(nearest_word("x", {}), std::nullopt);
}

TEST(ConfigRejects, WhatWouldGrowWithoutBound) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i)
    bomb += fmt::format("a{0}: &a{0} [*a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}]\n", i, i - 1);
  std::string ladder = "b0: &b0 x\n";
  for (int i = 1; i < 120; ++i) ladder += fmt::format("b{0}: &b{0} [*b{1}]\n", i, i - 1);
  const auto message = [](const std::string& text) {
    return message_of([&] { ConfigDocument::parse(text, "bad.yaml"); });
  };
  EXPECT_THAT(message(bomb), AllOf(StartsWith("bad.yaml:"), HasSubstr("the aliases repeat more than")));
  EXPECT_THAT(message(ladder), HasSubstr("nested more than 100 deep"));
  EXPECT_THAT(message("a: &a {b: *a}\n"), AllOf(StartsWith("bad.yaml:1"), HasSubstr("inside of what it names")));
  EXPECT_THAT(message("a: " + std::string(200000, '[')), HasSubstr("nested more than 100 deep"));
  std::string json;
  for (int i = 0; i < 200000; ++i) json += "{\"a\":\n";
  EXPECT_THAT(message(json), HasSubstr("nested more than 100 deep"));
  EXPECT_THAT(message("\"a\\0b\": 1\n"), HasSubstr("NUL"));
}

TEST(Config, ReadsAliases) {
  const ConfigDocument aliases = ConfigDocument::parse("a: &a {x: 1}\nb: *a\nc: [*a, *a]\n", "good.yaml");
  EXPECT_EQ(aliases.root().section("b").get<int>("x"), 1);
}

}  // namespace
}  // namespace doppel::config_test
