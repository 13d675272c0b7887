#pragma once

/// Parts of `doppel animate --format engine-glb`.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/actor/export/correctives/engine_clip.h"
#include "doppel/actor/trained_actor.h"

namespace doppel::tools {

/// Options of `--format engine-glb` alone.
struct EngineOptions {
  std::vector<std::string> unseen;
  int fit_windows = EngineClipOptions{}.windows;
  int helpers = 0;
};
void add_engine_options(CLI::App& app, EngineOptions& options);

/// @param written whether engine.glb is @param morphs whether --morphs was given
/// @throws UsageError for options that belong to another format, or exclude each other
void check_engine_options(const EngineOptions& options, bool written, bool morphs);

/// The takes of the training motions of a run, at the rate of the training.
std::vector<WindowSource> training_takes(const TrainedActor& actor);

/// What a file with bones lost, for `--json`.
nlohmann::json figure_json(const FigureReport& figure);
/// The same of an engine clip, with the errors of its clips.
nlohmann::json engine_json(const EngineClipReport& engine);
/// The same in lines.
std::string engine_text(const EngineClipReport& engine);

}  // namespace doppel::tools
