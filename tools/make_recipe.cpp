#include "make_recipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/config.h"
#include "doppel/train/builtin_recipes.h"

namespace doppel::tools {

namespace {

constexpr double kRecipeFrames = 300.0, kMaxFactor = 8.0;
constexpr long kMinSteps = 50;  // a stage of fewer steps has no end of its schedule

}  // namespace

std::string recipe_text() { return kBuiltinRecipes[0].text; }

std::vector<std::pair<std::string, long>> recipe_steps() {
  const YAML::Node recipe = YAML::Load(recipe_text());
  std::vector<std::pair<std::string, long>> steps;
  for (const char* stage : {"egnet", "lighting", "deltanet", "texnet"})
    steps.emplace_back(stage, recipe[stage]["train"]["iterations"].as<long>());
  return steps;
}

std::vector<std::string> fit_recipe(const std::map<std::string, double>& seconds_per_step, long frames, double budget) {
  double whole = 0.0;
  for (const auto& [stage, steps] : recipe_steps()) whole += static_cast<double>(steps) * seconds_per_step.at(stage);
  const double most = std::clamp(static_cast<double>(frames) / kRecipeFrames, 1.0, kMaxFactor);
  const double factor = std::min(most, budget / std::max(whole, 1e-9));
  std::vector<std::string> words;
  for (const auto& [stage, steps] : recipe_steps())
    words.push_back(fmt::format("{}.train.iterations={}", stage,
                                std::max(kMinSteps, std::lround(factor * static_cast<double>(steps)))));
  return words;
}

}  // namespace doppel::tools
