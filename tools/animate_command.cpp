#include <fmt/format.h>

#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>

#include "animate_clips.h"
#include "animate_files.h"
#include "animate_options.h"
#include "animate_performer.h"
#include "command.h"
#include "doppel/core/folder_lock.h"

namespace doppel::tools {
namespace {

/// The rate that was reached, and the time of each part of a frame.
nlohmann::ordered_json speed_json(const Profile& profile, int frames, double seconds) {
  nlohmann::ordered_json parts;
  for (const auto& [name, sum] : profile.parts()) parts[name] = 1000 * sum / frames;
  return {{"frames_per_second", frames / seconds}, {"milliseconds_a_frame", parts}};
}

std::string speed_text(const nlohmann::ordered_json& speed) {
  std::string text = fmt::format("{:.1f} frames a second", speed["frames_per_second"].get<double>());
  std::string between = "; milliseconds a frame: ";
  for (const auto& [name, value] : speed["milliseconds_a_frame"].items()) {
    text += fmt::format("{}{} {:.1f}", between, name, value.get<double>());
    between = ", ";
  }
  return text;
}

int run(const AnimateOptions& options, const CommonOptions& common) {
  check_animate_options(options);
  const Performer performer = make_performer(options);
  const Character& character = performer.character;
  if (options.wants("bvh")) renamed_bones(character, options.bone_names());  // refuses names before the frames
  const std::vector<Clip> clips = read_clips(options, character, performer.frames_per_second());
  const FolderLock lock(options.out);
  FileReports reports;
  Profile profile;
  const auto writers = make_writers(options, performer, clips, reports, profile);
  write_motions(options, character, clips[0].written, clips[0].frames.per_second);
  std::vector<MotionPart> parts;
  int frames = 0;
  for (const Clip& clip : clips) {
    parts.push_back({clip.motion, clip.steps, options.root == "in-place"});
    frames += clip.written.num_frames();
  }
  const auto start = std::chrono::steady_clock::now();
  perform(options, performer, parts, writers, profile);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const nlohmann::ordered_json speed = speed_json(profile, frames, elapsed.count());
  nlohmann::json report{{"speed", speed}, {"clips", clips_json(clips)}};
  if (clips.size() == 1 && clips[0].retargeting) report["retargeting"] = retargeting_json(*clips[0].retargeting);
  report.update({{"frames", frames},
                 {"frames_per_second", clips[0].frames.per_second},
                 {"vertices", character.num_vertices()},
                 {"formats", options.formats},
                 {"out", options.out}});
  report.update(files_json(options, reports));
  warn_of_targets(options, reports);
  if (common.json) {
    std::cout << report << "\n";
    return 0;
  }
  std::cout << frames << " frames of " << character.num_vertices() << " vertices written to " << options.out << "; "
            << speed_text(speed) << "\n"
            << clips_text(clips) << files_text(options, reports);
  return 0;
}

}  // namespace

Command add_animate(CLI::App& program) {
  auto options = std::make_shared<AnimateOptions>();
  CLI::App* app = program.add_subcommand("animate", "Drive a character with a motion: vertices, meshes, images, video");
  add_animate_options(*app, *options);
  return {app, [options](const CommonOptions& common) { return run(*options, common); }};
}

}  // namespace doppel::tools
