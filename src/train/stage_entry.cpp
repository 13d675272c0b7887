#include "doppel/train/stage_entry.h"

namespace doppel {

void open_folder(const StageTask& task, const Stage& stage) {
  const bool several = task.ranks && task.ranks->several();
  if (!several || task.ranks->is_first()) {
    task.folder.check(task.resolved, task.mode);
    if (task.mode != RunMode::overwrite)
      if (const auto found = CheckpointFolder(task.folder.checkpoints()).load_latest())
        check_same_data(found->second, stage, task.folder.path());
    task.folder.open(task.resolved, task.mode);
    if (task.accepted) task.accepted();
  }
  if (several) task.ranks->check_same("the configuration", task.resolved);
}

void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  if (rows.contains("static") || !evaluation.actor.static_texture.defined()) return;
  rows["static"] = evaluate_actor_drawing(evaluation, "static", Drawing::static_texture);
}

}  // namespace doppel
