#include "doppel/train/stage_entry.h"

namespace doppel {

void open_folder(const StageTask& task, Stage& stage) {
  const bool several = task.ranks && task.ranks->several();
  if (!several || task.ranks->is_first()) {
    task.folder.check(task.resolved, task.mode);
    std::optional<std::pair<std::int64_t, Checkpoint>> found;
    if (task.mode != RunMode::overwrite) found = CheckpointFolder(task.folder.checkpoints()).load_latest();
    if (found)
      check_same_data(found->second, stage, task.folder.path());
    else
      stage.begin();  // of several ranks, the others get the weights of this one
    task.folder.open(task.resolved, task.mode);
    if (!found && task.begins) task.begins();
  }
  if (several) task.ranks->check_same("the configuration", task.resolved);
}

void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  if (rows.contains("static") || !evaluation.actor.static_texture.defined()) return;
  rows["static"] = evaluate_actor_drawing(evaluation, "static", Drawing::static_texture);
}

}  // namespace doppel
