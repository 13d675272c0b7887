#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "animate_clips.h"
#include "animate_performer.h"
#include "doppel/actor/export/correctives/engine_clip.h"
#include "doppel/actor/export/figure_writer.h"
#include "doppel/actor/export/splat_rig.h"

namespace doppel::tools {

/// What the files with bones lost.
struct FileReports {
  FigureReport figure, fbx;
  SplatRigReport rig;
  EngineClipReport engine;
};

/// A writer for each kind of files. @param reports are filled in when the writers end
/// @throws UsageError for a format that the actor has nothing for
std::vector<std::unique_ptr<SequenceWriter>> make_writers(const AnimateOptions& options, const Performer& performer,
                                                          const std::vector<Clip>& clips, FileReports& reports,
                                                          Profile& profile);

/// The formats that need no surface: motion and bvh.
void write_motions(const AnimateOptions& options, const Character& character, const Motion& motion, double fps);

/// Warns of a .glb whose morph targets do not suffice.
void warn_of_targets(const AnimateOptions& options, const FileReports& reports);
/// A key for each file with bones, for `--json`.
nlohmann::json files_json(const AnimateOptions& options, const FileReports& reports);
/// A line for each file with bones.
std::string files_text(const AnimateOptions& options, const FileReports& reports);

}  // namespace doppel::tools
