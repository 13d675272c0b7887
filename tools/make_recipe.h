#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace doppel::tools {

/// What `doppel make` trains: the chain of `configs/small/ddc.yaml`, and on it the Gaussians of
/// `configs/small/gaussians.yaml`.
struct MakeRecipe {
  std::string text;                   ///< YAML, for `doppel train`
  std::vector<std::string> settings;  ///< --set arguments, `KEY=VALUE`
  /// The name of each stage and its training steps for 300 frames, in the order of training.
  std::vector<std::pair<std::string, long>> steps;
  std::map<std::string, long> warmup;  ///< steps of each stage in which the learning rate grows
};

/// @param tracked whether the poses are those of `doppel track`, which are some pixels off, and not given
MakeRecipe make_recipe(bool tracked);

/// How many steps of each stage fit into a time. The recipe's steps are those for 300 frames: more frames allow
/// proportionally more, at most eight times as many. All stages are cut in the same proportion.
/// @param seconds_per_step of each stage on this machine @param frames to train on @param budget seconds
/// @return --set arguments, `STAGE.train.iterations=N`, and `STAGE.train.warmup=N` where the steps are cut
std::vector<std::string> fit_recipe(const MakeRecipe& recipe, const std::map<std::string, double>& seconds_per_step,
                                    long frames, double budget);

}  // namespace doppel::tools
