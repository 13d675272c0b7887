#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/actor/trained_pose.h"
#include "doppel/eval/actor_evaluation.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// A stage that is about to be trained.
struct StageTask {
  const ConfigDocument& document;  ///< of the stage, as if it were alone in its file
  std::string resolved;            ///< the same as YAML, with every default
  std::filesystem::path run;       ///< where the stages before it are found
  const RunFolder& folder;         ///< its own
  RunMode mode = RunMode::automatic;
};

/// One kind of stage. The files of a stage define its entry; `stage_table.cpp` lists the
/// entries.
struct StageEntry {
  std::string name;                 ///< its section in a chain, its folder in a run
  std::vector<std::string> chains;  ///< the words of `stage:` it belongs to; its own name: it may stand alone
  std::vector<std::string> after;   ///< stages that must have been trained

  /// Reads all options of the stage, for its errors alone. @throws FileError at the key
  void (*check_options)(const ConfigDocument& document);
  TrainSummary (*train)(const StageTask& task);
  /// Adds what the stage's network is measured by to the rows of an evaluation; null: nothing.
  void (*evaluate)(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) = nullptr;
};

/// Trains a stage that begins a chain: it needs the character alone.
template <typename StageType, typename Config>
TrainSummary train_first(const StageTask& task) {
  const Config config = Config::read(task.document);
  const Dataset dataset = Dataset::open(config.subject.capture);
  const Character character = load_character(dataset.character_path(), config.subject.character);
  task.folder.open(task.resolved, task.mode);
  StageType stage(dataset, character, config);
  return Trainer(stage, config.trainer, task.folder).run();
}

/// Trains a stage that builds on what was trained before it. @param trained a TrainedActor or a TrainedPose
template <typename StageType, typename Config, typename Trained>
TrainSummary train_on(Trained trained, const StageTask& task) {
  const Dataset dataset = Dataset::open(trained.subject.capture);
  task.folder.open(task.resolved, task.mode);
  const Config config = Config::read(task.document);
  StageType stage(dataset, trained, config);
  return Trainer(stage, config.trainer, task.folder).run();
}

/// Adds the row `static`, the template's texture unlit, unless an earlier stage did.
void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows);

}  // namespace doppel
