#include "doppel/train/stage_entry.h"

namespace doppel {

void evaluate_static_texture(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  if (rows.contains("static") || !evaluation.actor.static_texture.defined()) return;
  rows["static"] = evaluate_actor_drawing(evaluation, "static", Drawing::static_texture);
}

}  // namespace doppel
