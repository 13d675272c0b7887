#include "animate_files.h"

#include <fmt/format.h>

#include <filesystem>

#include "animate_film.h"
#include "doppel/actor/export/texture_writer.h"
#include "doppel/character/bvh.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

FigureOptions figure_options(const AnimateOptions& options, double fps, const std::vector<ClipPart>& parts) {
  FigureOptions figure;
  figure.glb = options.wants("glb");
  figure.usda = options.wants("usda");
  figure.fbx = options.wants("fbx");
  figure.pc2 = options.wants("pc2");
  figure.mdd = options.wants("mdd");
  figure.frames_per_second = fps;
  figure.parts = parts;
  figure.names = options.bone_names();
  figure.rights = options.rights;
  figure.morphs = options.morphs;
  figure.tolerance = 0.001 * options.tolerance_mm;
  figure.compress = options.compress;
  figure.space = options.file_space();
  return figure;
}

std::unique_ptr<SequenceWriter> texture_writer(const AnimateOptions& options, const Performer& performer,
                                               const ResultFrames& frames) {
  const LookFunction texture = performer.texture();
  if (!texture)
    fail<UsageError>(
        "--format texture needs an actor with a dynamic texture: --run RUN with a trained TexNet, or --model FILE of "
        "such a run, exported without --geometry-only");
  return make_texture_writer(options.out, texture,
                             camera_path(options, performer.character, frames, read_studio(options)));
}

std::unique_ptr<SequenceWriter> splat_writer(const AnimateOptions& options, const Performer& performer,
                                             const ResultFrames& frames) {
  const SplatFunction splats = performer.splats();
  if (!splats)
    fail<UsageError>(
        "--format ply and splat-glb need an actor with Gaussians: --run RUN of `doppel train "
        "configs/small/gaussians.yaml --set capture=PREPARED --set ddc=CHAIN --out RUN`, or --model FILE of such a "
        "run");
  return make_splat_writer(options.out, splats, camera_path(options, performer.character, frames, read_studio(options)),
                           {options.wants("ply"), options.wants("splat-glb")});
}

std::unique_ptr<SequenceWriter> rig_writer(const AnimateOptions& options, const Performer& performer, double fps,
                                           const std::vector<ClipPart>& parts, SplatRigReport& report) {
  if (!performer.trained || !performer.trained->gaussians)
    fail<UsageError>(
        "--format splat-rig needs the Gaussians that all poses share, which a character and a file of --model do not "
        "have; give --run RUN of `doppel train configs/small/gaussians.yaml --set capture=PREPARED --set ddc=CHAIN "
        "--out RUN`");
  return make_splat_rig_writer(options.out, *performer.trained,
                               {fps, options.bone_names(), 0.001 * options.tolerance_mm, parts, options.compress},
                               report);
}

/// The actor, and the motions that its correctives are fitted to. @throws UsageError for a character alone
EngineTeacher engine_teacher(const AnimateOptions& options, const Performer& performer,
                             const std::vector<Clip>& clips) {
  if (options.renderer == "radiance")
    fail<UsageError>(
        "--format engine-glb holds the surface of EGNet and DeltaNet, and --renderer radiance another one; write "
        "engine.glb in a call of its own, without --renderer");
  EngineTeacher teacher;
  if (performer.trained) {
    teacher.geometry = [actor = performer.trained.get()](const torch::Tensor& windows) { return actor->fine(windows); };
    teacher.past_frames = performer.trained->past_frames();
    teacher.motions = training_takes(*performer.trained);
  } else if (performer.file) {
    teacher.geometry = [file = &*performer.file](const torch::Tensor& windows) { return file->forward(windows); };
    teacher.past_frames = performer.file->description().past_frames;
  } else {
    fail<UsageError>(
        "--format engine-glb: a character alone is skinned, and has no trained corrections that shapes could hold; "
        "give --run RUN, or --model FILE of `doppel export`");
  }
  teacher.frames_per_second = *performer.frames_per_second();
  for (const Clip& clip : clips) {
    if (clip.unseen) continue;
    WindowSource source{clip.motion, clip.steps.window};
    source.motion.frames.resize(static_cast<std::size_t>(fitted_frames(clip.motion.num_frames())));
    teacher.motions.push_back(std::move(source));
  }
  return teacher;
}

std::unique_ptr<SequenceWriter> engine_writer(const AnimateOptions& options, const Performer& performer,
                                              const std::vector<Clip>& clips, EngineClipReport& report) {
  EngineClipOptions engine;
  engine.frames_per_second = clips[0].frames.per_second;
  engine.names = options.bone_names();
  engine.tolerance = 0.001 * options.tolerance_mm;
  engine.windows = options.engine.fit_windows;
  engine.helpers = options.engine.helpers;
  engine.compress = options.compress;
  if (options.morphs) engine.shapes = *options.morphs;
  int first = 0;
  for (const Clip& clip : clips) {
    engine.parts.push_back({clips.size() > 1 ? clip.name : performer.character.name, first, clip.written.num_frames(),
                            clip.frames.per_second});
    engine.unseen.push_back(clip.unseen);
    first += clip.written.num_frames();
  }
  return make_engine_clip_writer(options.out, performer.character, engine_teacher(options, performer, clips), engine,
                                 report);
}

/// Gives the joints of a clip the names of --names. An End Site is called as its parent.
void rename_joints(const Character& character, BoneNames names, BvhClip& clip) {
  const std::map<std::string, std::string> renamed = renamed_bones(character, names);
  const std::string end = "_end";
  for (BvhJoint& joint : clip.joints) {
    const bool site = joint.channels.empty() && joint.name.size() > end.size() &&
                      joint.name.compare(joint.name.size() - end.size(), end.size(), end) == 0;
    const std::string bone = site ? joint.name.substr(0, joint.name.size() - end.size()) : joint.name;
    if (const auto found = renamed.find(bone); found != renamed.end()) joint.name = found->second + (site ? end : "");
  }
}

nlohmann::json rig_json(const SplatRigReport& rig) {
  nlohmann::json json = figure_json(rig.figure);
  json.erase("morphs");
  json.erase("morphs_at_once");
  json["gaussians"] = rig.gaussians;
  return json;
}

std::string targets_text(const FigureReport& figure) {
  if (figure.morphs == 1) return "1 morph target";
  return fmt::format("{} morph targets, of which at most {} {} at once", figure.morphs, figure.morphs_at_once,
                     figure.morphs_at_once == 1 ? "moves" : "move");
}

/// Ends the line of a file with bones.
std::string compression_text(const FigureReport& figure) {
  if (!figure.compression) return "\n";
  return fmt::format("; the compression moves them by {:.2f} mm at most\n", figure.compression->worst);
}

}  // namespace

std::vector<std::unique_ptr<SequenceWriter>> make_writers(const AnimateOptions& options, const Performer& performer,
                                                          const std::vector<Clip>& clips, FileReports& reports,
                                                          Profile& profile) {
  const Character& character = performer.character;
  const ResultFrames& frames = clips[0].frames;  // of formats that take one motion
  const std::vector<ClipPart> parts = parts_of(clips);
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  const FigureOptions files = figure_options(options, frames.per_second, parts);
  if (files.glb || files.usda || files.fbx || files.pc2 || files.mdd)
    writers.push_back(make_figure_writer(options.out, character, files, reports.figure, reports.fbx));
  if (options.wants("npy")) writers.push_back(make_npy_writer(options.out, character.num_vertices()));
  if (options.wants("obj")) writers.push_back(make_obj_writer(options.out, character, options.file_space()));
  if (options.wants("texture")) writers.push_back(texture_writer(options, performer, frames));
  if (options.wants("ply") || options.wants("splat-glb")) writers.push_back(splat_writer(options, performer, frames));
  if (options.wants("splat-rig"))
    writers.push_back(rig_writer(options, performer, frames.per_second, parts, reports.rig));
  if (options.wants("engine-glb")) writers.push_back(engine_writer(options, performer, clips, reports.engine));
  if (options.wants("mp4") || options.wants("png")) writers.push_back(film_writer(options, performer, frames, profile));
  return writers;
}

void write_motions(const AnimateOptions& options, const Character& character, const Motion& motion, double fps) {
  const fs::path folder(options.out);
  if (options.wants("motion")) write_motion(folder / "driven.motion", motion);
  if (!options.wants("bvh")) return;
  BvhClip clip = bvh_from_motion(character.skeleton, motion, fps, character.rest_dofs);
  rename_joints(character, options.bone_names(), clip);
  if (options.out_up == "z") clip = with_z_up(std::move(clip));
  write_bvh(folder / "driven.bvh", clip, options.out_unit.value_or(kBvhMetresPerUnit));
}

void warn_of_targets(const AnimateOptions& options, const FileReports& reports) {
  const FigureReport& figure = reports.figure;
  if (!figure.morphs_exhausted) return;
  log::warn(
      "the file has {}, and more than 256 are not written: vertices are off by {:.2f} mm on average and {:.1f} mm at "
      "most; {}a shorter clip has a nearer surface",
      targets_text(figure), figure.mean_error_mm, figure.worst_error_mm,
      options.morphs && *options.morphs < 256 ? "a larger --morphs, or none, or " : "");
}

nlohmann::json files_json(const AnimateOptions& options, const FileReports& reports) {
  nlohmann::json json = nlohmann::json::object();
  if (options.wants("glb")) json["glb"] = figure_json(reports.figure);
  if (options.wants("fbx")) json["fbx"] = figure_json(reports.fbx);
  if (options.wants("splat-rig")) json["splat_rig"] = rig_json(reports.rig);
  if (options.wants("engine-glb")) json["engine_glb"] = engine_json(reports.engine);
  return json;
}

std::string files_text(const AnimateOptions& options, const FileReports& reports) {
  std::string text;
  const FigureReport& rig = reports.rig.figure;
  const auto figure_text = [&](const char* format, const FigureReport& figure) {
    if (options.wants(format))
      text += fmt::format("animation.{}: {} bones, {}; vertices off by {:.2f} mm on average, {:.1f} mm at most{}",
                          format, figure.nodes, targets_text(figure), figure.mean_error_mm, figure.worst_error_mm,
                          compression_text(figure));
  };
  figure_text("glb", reports.figure);
  figure_text("fbx", reports.fbx);
  if (options.wants("splat-rig"))
    text +=
        fmt::format("splats_rig.glb: {} bones, {} Gaussians; centres off by {:.2f} mm on average, {:.1f} mm at most{}",
                    rig.nodes, reports.rig.gaussians, rig.mean_error_mm, rig.worst_error_mm, compression_text(rig));
  if (options.wants("engine-glb")) text += engine_text(reports.engine);
  return text;
}

}  // namespace doppel::tools
