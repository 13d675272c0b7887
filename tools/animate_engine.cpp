#include "animate_engine.h"

#include <fmt/format.h>

#include "doppel/core/error.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel::tools {

void add_engine_options(CLI::App& app, EngineOptions& options) {
  app.option_defaults()->group("Actors for engines (--format engine-glb)");
  app.add_option("--helpers", options.helpers,
                 "Joints besides the bones that move the clothes by ordinary skinning, in the place of corrective "
                 "shapes (--morphs); 0: shapes")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  app.add_option("--unseen", options.unseen,
                 "A motion like --motion that is written and measured, but not fitted; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--fit-windows", options.fit_windows,
                 "Pieces of motion, mixed from the given ones, that shapes or helpers are fitted to; more are nearer "
                 "to the actor and take longer")
      ->check(CLI::Range(100, 100000))
      ->capture_default_str();
}

void check_engine_options(const EngineOptions& options, bool written, bool morphs) {
  if (!options.unseen.empty() && !written)
    fail<UsageError>("--unseen belongs to --format engine-glb; other files are not fitted to motions, use --motion");
  if (options.helpers > 0 && !written)
    fail<UsageError>("--helpers belongs to --format engine-glb; other files have morph targets (--morphs)");
  if (options.helpers > 0 && morphs)
    fail<UsageError>(
        "--helpers {} and --morphs: engine.glb has helper joints or corrective shapes, not both; leave one of the "
        "options out",
        options.helpers);
}

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
  json.update({{"helpers", engine.helpers},
               {"inputs", engine.inputs},
               {"hidden", engine.hidden},
               {"history_seconds", engine.history}});
  for (const EngineClipError& clip : engine.clips) {
    json["clips"].push_back({{"name", clip.name}, {"unseen", clip.unseen}, {"frames", clip.frames}});
    if (clip.frames == 0) continue;
    json["clips"].back().update({{"skinning_mm", clip.skinning}, {"share_of_skinning", clip.share(clip.function)}});
    if (engine.helpers > 0)
      json["clips"].back().update(
          {{"helpers_mm", clip.function}, {"keys_mm", clip.best}, {"keys_share_of_skinning", clip.share(clip.best)}});
    else
      json["clips"].back().update({{"correctives_mm", clip.function}, {"best_weights_mm", clip.best}});
  }
  return json;
}

std::string engine_text(const EngineClipReport& engine) {
  const bool helpers = engine.helpers > 0;
  std::string text =
      fmt::format("engine.glb: {} bones, {} {}, {} inputs, {} hidden units, {:.2f} s of history\n",
                  engine.figure.nodes - engine.helpers, helpers ? engine.helpers : engine.figure.morphs,
                  helpers ? "helper joints" : "corrective shapes", engine.inputs, engine.hidden, engine.history);
  if (engine.figure.compression)
    text += fmt::format("  the compression moves vertices by {:.2f} mm at most\n", engine.figure.compression->worst);
  for (const EngineClipError& clip : engine.clips) {
    if (clip.frames == 0) continue;
    text += fmt::format(
        "  {} ({}{} frames): vertices off by {:.2f} mm on average, {:.0f} % of the {:.2f} mm of skinning; with the "
        "{} {:.2f} mm\n",
        clip.name, clip.unseen ? "unseen, " : "last fifth, ", clip.frames, clip.function,
        100.0 * clip.share(clip.function), clip.skinning, helpers ? "keys in the file" : "best weights", clip.best);
  }
  return text;
}

}  // namespace doppel::tools
