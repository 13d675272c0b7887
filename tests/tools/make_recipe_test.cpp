// The time that `doppel make` has, as numbers of training steps.
#include "make_recipe.h"

#include <gtest/gtest.h>

#include <map>

#include "make_chain.h"

namespace doppel::tools::make_recipe_test {
namespace {

/// The steps that `fit_recipe` sets, by stage.
std::map<std::string, long> steps_of(const std::vector<std::string>& settings) {
  std::map<std::string, long> steps;
  for (const std::string& setting : settings)
    steps[setting.substr(0, setting.find('.'))] = std::stol(setting.substr(setting.find('=') + 1));
  return steps;
}

std::map<std::string, double> every_step_takes(double seconds) {
  std::map<std::string, double> speeds;
  for (const auto& [stage, steps] : recipe_steps()) speeds[stage] = seconds;
  return speeds;
}

long total(const std::map<std::string, long>& steps) {
  long sum = 0;
  for (const auto& [stage, count] : steps) sum += count;
  return sum;
}

TEST(MakeRecipe, HasTheStepsOfItsFileWhereTheTimeSuffices) {
  const auto found = steps_of(fit_recipe(every_step_takes(0.1), 300, 1e6));
  for (const auto& [stage, steps] : recipe_steps()) EXPECT_EQ(found.at(stage), steps) << stage;
}

TEST(MakeRecipe, FillsTheTimeInTheSameProportion) {
  const long whole = total(steps_of(fit_recipe(every_step_takes(0.1), 300, 1e6)));
  const auto half = steps_of(fit_recipe(every_step_takes(0.1), 300, 0.05 * static_cast<double>(whole)));
  for (const auto& [stage, steps] : recipe_steps()) EXPECT_EQ(half.at(stage), steps / 2) << stage;
}

TEST(MakeRecipe, TrainsLongerOnMoreFrames) {
  const auto found = steps_of(fit_recipe(every_step_takes(0.1), 900, 1e6));
  for (const auto& [stage, steps] : recipe_steps()) EXPECT_EQ(found.at(stage), 3 * steps) << stage;
}

TEST(MakeChainReference, CommandLinesAreQuotedAsShellsNeedIt) {
  EXPECT_EQ(command_line({"make", "a b", "it's", ""}), "doppel make 'a b' 'it'\\''s' ''");
}

}  // namespace
}  // namespace doppel::tools::make_recipe_test
