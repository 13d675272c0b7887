// The time that `doppel make` has, as numbers of training steps.
#include "make_recipe.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "doppel/train/stage_chain.h"
#include "make_chain.h"

namespace doppel::tools::make_recipe_test {
namespace {

const MakeRecipe& recipe() {
  static const MakeRecipe kRecipe = make_recipe(false);
  return kRecipe;
}

/// The steps that `fit_recipe` sets, by stage.
std::map<std::string, long> steps_of(const std::vector<std::string>& settings) {
  std::map<std::string, long> steps;
  for (const std::string& setting : settings)
    if (setting.find(".train.iterations=") != std::string::npos)
      steps[setting.substr(0, setting.find('.'))] = std::stol(setting.substr(setting.find('=') + 1));
  return steps;
}

std::map<std::string, double> every_step_takes(double seconds) {
  std::map<std::string, double> speeds;
  for (const auto& [stage, steps] : recipe().steps) speeds[stage] = seconds;
  return speeds;
}

long total(const std::map<std::string, long>& steps) {
  long sum = 0;
  for (const auto& [stage, count] : steps) sum += count;
  return sum;
}

TEST(MakeRecipe, HasTheStepsOfItsFileWhereTheTimeSuffices) {
  const auto found = steps_of(fit_recipe(recipe(), every_step_takes(0.1), 300, 1e6));
  for (const auto& [stage, steps] : recipe().steps) EXPECT_EQ(found.at(stage), steps) << stage;
}

TEST(MakeRecipe, FillsTheTimeInTheSameProportion) {
  const long whole = total(steps_of(fit_recipe(recipe(), every_step_takes(0.1), 300, 1e6)));
  const auto half = steps_of(fit_recipe(recipe(), every_step_takes(0.1), 300, 0.05 * static_cast<double>(whole)));
  for (const auto& [stage, steps] : recipe().steps) EXPECT_EQ(half.at(stage), steps / 2) << stage;
}

TEST(MakeRecipe, TrainsLongerOnMoreFrames) {
  const auto found = steps_of(fit_recipe(recipe(), every_step_takes(0.1), 900, 1e6));
  for (const auto& [stage, steps] : recipe().steps) EXPECT_EQ(found.at(stage), 3 * steps) << stage;
}

/// Where little time is left, the learning rate still reaches its height and falls again.
TEST(MakeRecipe, ShortensTheWarmUpWithTheSteps) {
  const std::vector<std::string> settings = fit_recipe(recipe(), every_step_takes(0.1), 300, 1.0);
  const auto expect = [&](const std::string& setting, bool there) {
    EXPECT_EQ(std::find(settings.begin(), settings.end(), setting) != settings.end(), there) << setting;
  };
  expect("egnet.train.iterations=50", true);
  const auto steps_of_stage = [&](const std::string& name) {
    return std::find_if(recipe().steps.begin(), recipe().steps.end(), [&](const auto& e) { return e.first == name; })
        ->second;
  };
  expect(fmt::format("egnet.train.warmup={}", 100 * 50 / steps_of_stage("egnet")), true);
  expect(fmt::format("deltanet.train.warmup={}", 100 * 50 / steps_of_stage("deltanet")), true);
  for (const std::string& setting : fit_recipe(recipe(), every_step_takes(0.1), 300, 1e6))
    EXPECT_EQ(setting.find("warmup"), std::string::npos) << setting;
}

/// Both recipes are chains that `doppel train` accepts.
TEST(MakeRecipe, IsAChainWithGaussiansAtItsEnd) {
  for (const bool tracked : {false, true}) {
    const MakeRecipe made = make_recipe(tracked);
    std::vector<std::string> settings = made.settings;
    settings.emplace_back("capture=prepared");
    const StageChain chain = StageChain::read(ConfigDocument::parse(made.text, "recipe.yaml", settings));
    ASSERT_EQ(made.steps.size(), 5u);
    for (const auto& [stage, steps] : made.steps) EXPECT_TRUE(chain.has(stage)) << stage;
    EXPECT_EQ(made.steps.back().first, "gaussians");
    EXPECT_EQ(made.steps.back().second, tracked ? 600 : 3000);
  }
}

TEST(MakeRecipe, SettingsOfFilmReachTheirStages) {
  const MakeRecipe film = make_recipe(true);
  const ConfigReader root = ConfigDocument::parse(film.text, "recipe.yaml", film.settings).root();
  EXPECT_EQ(root.section("egnet").section("loss").get<double>("anchor"), 1e7);
  EXPECT_EQ(root.section("egnet").section("loss").get<double>("arap"), 1500.0);
  EXPECT_EQ(root.section("texnet").section("model").get<int>("size"), 256);
  EXPECT_EQ(root.section("texnet").section("model").get<int>("detail"), 4);
  EXPECT_FALSE(root.section("gaussians").section("model").get<bool>("network"));
}

TEST(MakeChainReference, CommandLinesAreQuotedAsShellsNeedIt) {
  EXPECT_EQ(command_line({"make", "a b", "it's", ""}), "doppel make 'a b' 'it'\\''s' ''");
}

TEST(ExpectedTime, FollowsTheSpeedOfTheStepsBefore) {
  const std::vector<PlannedStep> plan{{"a", 1.0}, {"b", 100.0}, {"skipped", 50.0}, {"c", 10.0}, {"d", 60.0, 1000.0}};
  const ProgressChain first = expected_time(plan, 1, {{"a", 0.1}});
  EXPECT_EQ(first.position, "[2/5]");
  EXPECT_DOUBLE_EQ(first.step_seconds, 100.0) << "a step of a second tells nothing";
  EXPECT_DOUBLE_EQ(first.later_seconds, 60.0 + (1000.0 - 0.1 - 100.0 - 60.0)) << "the last step fills the time";
  const ProgressChain later = expected_time(plan, 3, {{"a", 2.0}, {"b", 200.0}});
  EXPECT_DOUBLE_EQ(later.step_seconds, 20.0);
  EXPECT_DOUBLE_EQ(later.later_seconds, 1000.0 - 202.0 - 20.0);
  const ProgressChain late = expected_time(plan, 4, {{"b", 990.0}});
  EXPECT_DOUBLE_EQ(late.step_seconds, 60.0) << "its least time";
}

}  // namespace
}  // namespace doppel::tools::make_recipe_test
