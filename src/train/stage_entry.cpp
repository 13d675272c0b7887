#include "doppel/train/stage_entry.h"

namespace doppel {

void open_folder(const StageTask& task) {
  const bool several = task.ranks && task.ranks->several();
  if (!several || task.ranks->is_first()) task.folder.open(task.resolved, task.mode);
  if (several) task.ranks->check_same("the configuration", task.resolved);
}

void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  if (rows.contains("static") || !evaluation.actor.static_texture.defined()) return;
  rows["static"] = evaluate_actor_drawing(evaluation, "static", Drawing::static_texture);
}

}  // namespace doppel
