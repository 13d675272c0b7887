#pragma once

#include <map>
#include <string>
#include <vector>

namespace doppel::tools {

/// Steps of each stage of `configs/small/ddc.yaml`, the recipe of `doppel make`, in the order of training.
std::vector<std::pair<std::string, long>> recipe_steps();
/// The text of `configs/small/ddc.yaml`.
std::string recipe_text();

/// How many steps of each stage fit into a time. The recipe's steps are those for 300 frames: more frames allow
/// proportionally more, at most eight times as many. All stages are cut in the same proportion.
/// @param seconds_per_step of each stage on this machine @param frames to train on @param budget seconds
/// @return --set arguments, `STAGE.train.iterations=N`
std::vector<std::string> fit_recipe(const std::map<std::string, double>& seconds_per_step, long frames, double budget);

}  // namespace doppel::tools
