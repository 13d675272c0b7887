#pragma once

#include <torch/nn/module.h>

#include <cstdint>
#include <filesystem>
#include <optional>

#include "doppel/actor/checkpoint.h"
#include "doppel/actor/run_stages.h"
#include "doppel/character/character.h"
#include "doppel/core/config.h"

namespace doppel {

/// A stage on disk: its configuration and the checkpoint to use, the best if the run keeps the best, else the newest.
struct StoredStage {
  ConfigDocument config;
  std::int64_t step;
  Checkpoint checkpoint;
};

/// Reads a stage of a run. @return nothing when the run has no such stage, or no checkpoint of it
std::optional<StoredStage> find_stage(const std::filesystem::path& run, const std::string& stage);

/// Checks that a stage was trained for `character`. @throws Error when it was trained for another character
void check_character(const StoredStage& stage, const Character& character, const std::filesystem::path& run,
                     const std::filesystem::path& character_path);

/// Loads the evaluation weights and buffers of a checkpoint into a module: the running mean of the weights if the run
/// kept one, and recalibrated statistics. Switches the module to evaluation mode and its gradients off.
void load_evaluation_weights(torch::nn::Module& network, const Checkpoint& checkpoint);

/// A digest of the parameters and buffers of a module.
std::uint32_t weights_checksum(const torch::nn::Module& module);

}  // namespace doppel
