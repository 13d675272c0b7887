#include "animate_clips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "doppel/character/loop_motion.h"
#include "doppel/character/resample_motion.h"
#include "doppel/core/angles.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

MotionFileOptions motion_options(const AnimateOptions& options, const std::string& motion, const Rates& rates) {
  MotionFileOptions result;
  result.map = options.map;
  result.source_skeleton = options.source_skeleton;
  const auto is_foreign = [&](const std::string& file) {
    return !options.source_skeleton.empty() || is_foreign_motion(file);
  };
  // Options for files of other bodies do not concern the motions of the character that stand beside them.
  if (is_foreign(motion) || std::none_of(options.motions.begin(), options.motions.end(), is_foreign)) {
    result.source.animation = options.animation;
    result.source.person = options.person;
    if (!options.up.empty()) result.source.up = options.up[0];
    if (options.unit > 0) result.source.metres_per_unit = options.unit;
  }
  result.source.frames_per_second = rates.source;
  // The rows of the character's own motion are read as they are. A loop needs frames at the times of the result.
  const bool rows_stay =
      options.source_skeleton.empty() && !is_foreign_motion(motion) && rates.source > 0 && !options.loop;
  result.frames_per_second = rows_stay ? rates.source : reading_rate(rates);
  return result;
}

/// @param file name of the map
void write_guessed_map(const AnimateOptions& options, const std::string& file, const JointMap& map) {
  const fs::path path = fs::path(options.out) / file;
  write_atomically(path, joint_map_text(map));
  log::info("{} joints were paired, see {}; if pairs are wrong, correct the file and pass it with --map",
            map.pairs.size(), path.string());
}

/// Logs how well the character follows, by the end that stays farthest away.
void log_retargeting(const RetargetResult& result, int frames) {
  const RetargetResult::Track* worst = nullptr;
  for (const RetargetResult::Track& track : result.tracks)
    if (track.end && (!worst || track.largest_distance > worst->largest_distance)) worst = &track;
  if (worst)
    log::info(
        "retargeted {} frames at scale {:.3f}; of feet, hands and head, {} is farthest from the scaled source: {:.1f} "
        "cm",
        frames, result.scale, worst->target, 100 * worst->largest_distance);
}

/// The motion of the character: read from its file, or retargeted from another body.
/// @param name of the clip, for the map of one of several motions
MotionFromFile driven_motion(const AnimateOptions& options, const std::string& motion, const std::string& name,
                             const Character& character, const Rates& rates) {
  MotionFromFile read = read_motion_file(motion, character, motion_options(options, motion, rates));
  for (const std::string& note : read.notes) log::info("{}: {}", motion, note);
  for (const std::string& warning : read.warnings) log::warn("{}: {}", motion, warning);
  if (read.guessed_map)
    write_guessed_map(
        options,
        options.motions.size() + options.engine.unseen.size() > 1 ? "joint_map_" + name + ".yaml" : "joint_map.yaml",
        *read.guessed_map);
  if (read.retargeting) log_retargeting(*read.retargeting, read.motion.num_frames());
  return read;
}

/// The names of clips: those of their files, and numbers where they repeat.
std::vector<std::string> clip_names(const std::vector<std::string>& files) {
  std::vector<std::string> names;
  for (const std::string& file : files) {
    const std::string stem = fs::path(file).stem().string();
    std::string name = stem;
    for (int number = 2; std::find(names.begin(), names.end(), name) != names.end(); ++number)
      name = fmt::format("{}_{}", stem, number);
    names.push_back(name);
  }
  return names;
}

/// The root of a skeleton whose way can be taken out. @throws UsageError for --root in-place and another skeleton
std::optional<Skeleton::Root> travelling_root(const AnimateOptions& options, const Character& character) {
  const std::optional<Skeleton::Root> root = root_that_travels(character.skeleton);
  if (!root && options.root == "in-place")
    fail<UsageError>("--root in-place: the root of '{}' is not three translations followed by three rotations",
                     character.name);
  return root;
}

/// Makes the motion of a clip cyclic. Someone who comes back ends where he began. Someone who travels goes on from
/// where he is; with --root in-place his heading closes, because his way is taken out later and his turn is not.
void make_loop(const AnimateOptions& options, const Character& character, double fps, Clip& clip) {
  const Skeleton& skeleton = character.skeleton;
  const int blend = blended_frames(clip.motion.num_frames(), fps, static_cast<int>(std::lround(clip.steps.frame)));
  const std::optional<Skeleton::Root> root = travelling_root(options, character);
  GroundStep step;
  if (root) step = loop_step(clip.motion, *root, blend);
  if (options.root == "in-place") step.turn = 0.0;
  if (options.root == "in-place" || is_travel(step)) {
    clip.motion = travelling_loop(clip.motion, skeleton, *root, blend, step);
    if (options.root == "travel") clip.step = step;
  } else {
    clip.motion = loop_motion(clip.motion, skeleton, blend);
  }
  if (clip.step)
    log::info("{}: a repetition starts {:.2f} m along x and {:.2f} m along z further, turned by {:.1f} degrees",
              clip.file, step.way().x(), step.way().y(), step.turn / kRadiansPerDegree);
}

Clip read_clip(const AnimateOptions& options, const std::string& file, const std::string& name,
               const Character& character, std::optional<double> training_rate) {
  const Rates rates = rates_of(file, {options.source_fps, options.fps, training_rate});
  MotionFromFile read = driven_motion(options, file, name, character, rates);
  const double fps = rates.result > 0 ? rates.result : read.frames_per_second;
  Clip clip;
  clip.name = name;
  clip.file = file;
  clip.steps = frame_steps(rates, read.frames_per_second, fps);
  clip.retargeting = std::move(read.retargeting);
  clip.frames = {fps, is_foreign_motion(file) ? 1.0 : row_step(rates, fps)};
  clip.motion = std::move(read.motion);
  if (options.loop) make_loop(options, character, read.frames_per_second, clip);
  clip.written = resample(clip.motion, character.skeleton, clip.steps.frame);
  if (options.root == "in-place") clip.written = in_place(*travelling_root(options, character), clip.written);
  return clip;
}

}  // namespace

std::vector<Clip> read_clips(const AnimateOptions& options, const Character& character,
                             std::optional<double> training_rate) {
  std::vector<std::string> files = options.motions;
  files.insert(files.end(), options.engine.unseen.begin(), options.engine.unseen.end());
  const std::vector<std::string> names = clip_names(files);
  std::vector<Clip> clips;
  for (std::size_t i = 0; i < names.size(); ++i) {
    clips.push_back(read_clip(options, files[i], names[i], character, training_rate));
    clips.back().unseen = i >= options.motions.size();
  }
  return clips;
}

std::vector<ClipPart> parts_of(const std::vector<Clip>& clips) {
  std::vector<ClipPart> parts;
  int first = 0;
  for (const Clip& clip : clips) {
    if (clips.size() > 1) parts.push_back({clip.name, first, clip.written.num_frames(), clip.frames.per_second});
    first += clip.written.num_frames();
  }
  return parts;
}

nlohmann::json retargeting_json(const RetargetResult& result) {
  nlohmann::json tracks;
  for (const RetargetResult::Track& track : result.tracks)
    tracks.push_back({{"target", track.target},
                      {"source", track.source},
                      {"mean_distance_m", track.mean_distance},
                      {"largest_distance_m", track.largest_distance}});
  return {{"scale", result.scale}, {"joints", tracks}};
}

nlohmann::json clips_json(const std::vector<Clip>& clips) {
  nlohmann::json list;
  for (const Clip& clip : clips) {
    nlohmann::json entry{{"name", clip.name},
                         {"motion", clip.file},
                         {"frames", clip.written.num_frames()},
                         {"frames_per_second", clip.frames.per_second}};
    if (clip.retargeting) entry["retargeting"] = retargeting_json(*clip.retargeting);
    if (clip.step)
      entry["loop"] = {{"way_m", {clip.step->way().x(), clip.step->way().y()}},
                       {"turn_degrees", clip.step->turn / kRadiansPerDegree}};
    list.push_back(entry);
  }
  return list;
}

std::string clips_text(const std::vector<Clip>& clips) {
  if (clips.size() < 2) return "";
  std::string text = "animations:";
  for (const Clip& clip : clips)
    text += fmt::format("{} {} ({} frames)", &clip == &clips[0] ? "" : ",", clip.name, clip.written.num_frames());
  return text + "\n";
}

}  // namespace doppel::tools
