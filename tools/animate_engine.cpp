#include "animate_engine.h"

#include <fmt/format.h>

#include "doppel/data/dataset/dataset.h"

namespace doppel::tools {

std::vector<WindowSource> training_takes(const TrainedActor& actor) {
  std::vector<WindowSource> takes;
  const Dataset dataset = actor.subject.open_dataset();
  for (const DatasetSequence& sequence : dataset.sequences()) {
    if (sequence.split != Split::train || !sequence.has_motion()) continue;
    long start = -1;
    for (long row = sequence.first_frame; row <= sequence.last_frame; ++row) {
      if (sequence.segment_start(row) != start) takes.emplace_back();
      start = sequence.segment_start(row);
      takes.back().motion.frames.push_back(sequence.motion.frames.at(static_cast<std::size_t>(row)));
    }
  }
  return takes;
}

nlohmann::json figure_json(const FigureReport& figure) {
  nlohmann::json json = {{"nodes", figure.nodes},
                         {"morphs", figure.morphs},
                         {"morphs_at_once", figure.morphs_at_once},
                         {"keys", figure.keys},
                         {"mean_error_mm", figure.mean_error_mm},
                         {"worst_error_mm", figure.worst_error_mm},
                         {"largest_dropped_weight", figure.largest_dropped_weight}};
  if (figure.compression)
    json["compression"] = {{"mean_error_mm", figure.compression->mean}, {"worst_error_mm", figure.compression->worst}};
  return json;
}

nlohmann::json engine_json(const EngineClipReport& engine) {
  nlohmann::json json = figure_json(engine.figure);
  json.erase("morphs_at_once");
  json.update({{"inputs", engine.inputs}, {"hidden", engine.hidden}, {"history_seconds", engine.history}});
  for (const EngineClipError& clip : engine.clips) {
    json["clips"].push_back({{"name", clip.name}, {"unseen", clip.unseen}, {"frames", clip.frames}});
    if (clip.frames == 0) continue;
    json["clips"].back().update({{"skinning_mm", clip.skinning},
                                 {"correctives_mm", clip.correctives},
                                 {"best_weights_mm", clip.best},
                                 {"share_of_skinning", clip.share()}});
  }
  return json;
}

std::string engine_text(const EngineClipReport& engine) {
  std::string text =
      fmt::format("engine.glb: {} bones, {} corrective shapes, {} inputs, {} hidden units, {:.2f} s of history\n",
                  engine.figure.nodes, engine.figure.morphs, engine.inputs, engine.hidden, engine.history);
  for (const EngineClipError& clip : engine.clips) {
    if (clip.frames == 0) continue;
    text += fmt::format(
        "  {} ({}{} frames): vertices off by {:.2f} mm on average, {:.0f} % of the {:.2f} mm of skinning; with the "
        "best weights {:.2f} mm\n",
        clip.name, clip.unseen ? "unseen, " : "last fifth, ", clip.frames, clip.correctives, 100.0 * clip.share(),
        clip.skinning, clip.best);
  }
  return text;
}

}  // namespace doppel::tools
