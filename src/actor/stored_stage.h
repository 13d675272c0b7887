#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <filesystem>
#include <optional>

#include "doppel/character/character.h"
#include "doppel/core/config.h"
#include "doppel/actor/checkpoint.h"
#include "doppel/actor/run_stages.h"

namespace doppel {

/// A stage on disk: its configuration and its newest checkpoint.
struct StoredStage {
  ConfigDocument config;
  std::int64_t step;
  Checkpoint checkpoint;
};

/// Nothing when the run has no such stage, or no checkpoint of it yet.
std::optional<StoredStage> find_stage(const std::filesystem::path& run, const std::string& stage);

/// @throws Error when the checkpoint was trained for another character
void check_character(const StoredStage& stage, const Character& character, const std::filesystem::path& run,
                     const std::filesystem::path& character_path);

/// Puts the weights and buffers that a checkpoint means for use into a module: the running mean of the weights where
/// the run kept one, recalibrated statistics. Switches it to evaluation mode; no parameter needs a gradient any more.
void load_evaluation_weights(torch::nn::Module& network, const Checkpoint& checkpoint);

/// A digest of the parameters and buffers of a module.
std::uint32_t weights_checksum(const torch::nn::Module& module);

}  // namespace doppel
