#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/actor/trained_pose.h"
#include "doppel/eval/actor_evaluation.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// A stage to train.
struct StageTask {
  const ConfigDocument& document;  ///< of the stage, as in a file of that stage alone
  std::string resolved;            ///< the same as YAML, with what the command line set
  std::filesystem::path run;       ///< the run with the earlier stages
  const RunFolder& folder;         ///< the folder of this stage
  RunMode mode = RunMode::automatic;
  Ranks* ranks = nullptr;        ///< that train together; null: this process alone
  std::function<void()> begins;  ///< called when the stage is about to take its first step; may be empty
};

/// One kind of stage. The files of a stage define its entry; `stage_table.h` lists all entries.
struct StageEntry {
  std::string name;                 ///< its section in a chain and its folder in a run
  std::vector<std::string> chains;  ///< the values of `stage:` that include it; its own name: it may be trained alone
  std::vector<std::string> after;   ///< stages that must be trained before

  /// Reads all options of the stage to find errors. @throws FileError at the key
  void (*check_options)(const ConfigDocument& document);
  /// Trains the stage.
  std::function<TrainSummary(const StageTask& task)> train;
  /// Adds rows about the stage's network to an evaluation; null: none.
  void (*evaluate)(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) = nullptr;
};

/// Opens the run folder; if no run is resumed, the stage begins first (Stage::begin). Of several ranks, only rank 0
/// writes it; the others wait, and compare their configuration.
/// @throws UsageError as RunFolder::open, or when the folder's checkpoint is of other data; the folder is then
/// unchanged
void open_folder(const StageTask& task, Stage& stage);

/// Trains a stage that begins a chain and needs only the character.
template <typename StageType, typename Config>
TrainSummary train_first(const StageTask& task) {
  const Config config = Config::read(task.document);
  const Dataset dataset = config.subject.open_dataset();
  const Character character = load_character(dataset.character_path(), config.subject.character);
  StageType stage(dataset, character, config);
  open_folder(task, stage);  // last, because it may erase an earlier run
  return Trainer(stage, config.trainer, task.folder, task.ranks).run();
}

/// Trains a stage that builds on earlier stages. @param trained a TrainedActor or a TrainedPose
template <typename StageType, typename Config, typename Trained>
TrainSummary train_on(Trained trained, const StageTask& task) {
  const Dataset dataset = trained.subject.open_dataset();
  const Config config = Config::read(task.document);
  StageType stage(dataset, trained, config);
  open_folder(task, stage);  // last, because it may erase an earlier run
  return Trainer(stage, config.trainer, task.folder, task.ranks).run();
}

/// The entry of a stage that builds on an actor trained by the earlier stages.
template <typename StageType, typename Config>
StageEntry actor_stage_entry(const std::string& name, std::vector<std::string> chains, std::vector<std::string> after,
                             decltype(StageEntry::evaluate) evaluate) {
  return {name,
          std::move(chains),
          std::move(after),
          [](const ConfigDocument& document) { Config::read(document); },
          [name](const StageTask& task) {
            return train_on<StageType, Config>(TrainedActor::load(task.run, std::nullopt, name), task);
          },
          evaluate};
}

/// Adds the row `static`, the static texture without lighting, unless an earlier stage added it.
void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows);

}  // namespace doppel
