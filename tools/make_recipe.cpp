#include "make_recipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/train/builtin_recipes.h"

namespace doppel::tools {

namespace {

constexpr double kRecipeFrames = 300.0, kMaxFactor = 8.0;
constexpr long kMinSteps = 50;  // a stage of fewer steps has no end of its schedule

// Where the poses are tracked, they are some pixels off. Outlines of few cameras do not show where clothes slide: the
// recipe's EGNet would pull the surface along itself, TexNet's finer texels would blur what then disagrees, and the
// network of the Gaussians gains nothing (docs/results/filmed.md).
constexpr std::array kFilmSettings{"egnet.loss.anchor=1e7",         "egnet.loss.arap=1500",
                                   "texnet.model.size=256",         "texnet.model.detail=4",
                                   "gaussians.model.network=false", "gaussians.train.iterations=600"};

/// The text of `configs/small/NAME.yaml`.
std::string builtin_text(std::string_view name) {
  const auto found = std::find_if(kBuiltinRecipes.begin(), kBuiltinRecipes.end(),
                                  [&](const BuiltinFile& file) { return file.name == name; });
  if (found == kBuiltinRecipes.end()) fail("configs/small/{}.yaml is not built in", name);
  return found->text;
}

}  // namespace

MakeRecipe make_recipe(bool tracked) {
  MakeRecipe recipe;
  const std::string gaussians = builtin_text("gaussians");
  const std::size_t section = gaussians.find("\ngaussians:\n");
  if (section == std::string::npos) fail("configs/small/gaussians.yaml has no section `gaussians`");
  recipe.text = builtin_text("ddc") + gaussians.substr(section);
  if (tracked) recipe.settings.assign(kFilmSettings.begin(), kFilmSettings.end());
  const ConfigReader root = ConfigDocument::parse(recipe.text, "recipe.yaml", recipe.settings).root();
  for (const char* stage : {"egnet", "lighting", "deltanet", "texnet", "gaussians"}) {
    const ConfigReader train = root.section(stage).section("train");
    recipe.steps.emplace_back(stage, train.get<long>("iterations"));
    recipe.warmup[stage] = train.get<long>("warmup", 0);
  }
  return recipe;
}

std::vector<std::string> fit_recipe(const MakeRecipe& recipe, const std::map<std::string, double>& seconds_per_step,
                                    long frames, double budget) {
  double whole = 0.0;
  for (const auto& [stage, steps] : recipe.steps) whole += static_cast<double>(steps) * seconds_per_step.at(stage);
  const double most = std::clamp(static_cast<double>(frames) / kRecipeFrames, 1.0, kMaxFactor);
  const double factor = std::min(most, budget / std::max(whole, 1e-9));
  std::vector<std::string> words;
  for (const auto& [stage, steps] : recipe.steps) {
    const long fitted = std::max(kMinSteps, std::lround(factor * static_cast<double>(steps)));
    words.push_back(fmt::format("{}.train.iterations={}", stage, fitted));
    // The learning rate must reach its height and fall again.
    if (const long warmup = recipe.warmup.at(stage); warmup > 0 && fitted < steps)
      words.push_back(fmt::format("{}.train.warmup={}", stage, warmup * fitted / steps));
  }
  return words;
}

}  // namespace doppel::tools
