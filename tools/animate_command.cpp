#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "doppel/character/character.h"
#include "doppel/core/error.h"
#include "doppel/export/animation.h"

namespace doppel::tools {
namespace {

struct AnimateOptions {
  std::string character, motion, model, out;
  std::vector<std::string> formats{"npy"};
  std::string bone_rule = "exact";
  TurntableOptions turntable;
};

std::vector<std::unique_ptr<SequenceWriter>> make_writers(const AnimateOptions& options, const Character& character) {
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  for (const std::string& format : options.formats) {
    if (format == "npy") writers.push_back(make_npy_writer(options.out, character.num_vertices()));
    if (format == "obj") writers.push_back(make_obj_writer(options.out, character));
    if (format == "mp4") writers.push_back(make_video_writer(options.out, character, options.turntable));
  }
  return writers;
}

int run(const AnimateOptions& options, const CommonOptions& common) {
  CharacterOptions character_options;
  character_options.bone_rule = options.bone_rule == "prefix" ? BoneRule::prefix : BoneRule::exact;
  const Character character = load_character(options.character, character_options);
  const Motion motion = read_motion(options.motion, character.num_dofs());
  std::optional<ActorFile> actor;
  if (!options.model.empty()) actor = ActorFile::load(options.model);
  animate(character, motion, actor ? &*actor : nullptr, make_writers(options, character));
  if (common.json)
    std::cout << nlohmann::json{{"frames", motion.num_frames()},
                                {"vertices", character.num_vertices()},
                                {"formats", options.formats},
                                {"out", options.out}}
              << "\n";
  else
    std::cout << motion.num_frames() << " frames of " << character.num_vertices() << " vertices written to "
              << options.out << "\n";
  return 0;
}

}  // namespace

Command add_animate(CLI::App& program) {
  auto options = std::make_shared<AnimateOptions>();
  CLI::App* app = program.add_subcommand("animate", "Pose a character with a motion: vertices, meshes or a video");
  app->add_option("--character", options->character, "The .character file")->required();
  app->add_option("--motion", options->motion, "The .motion file that drives it")->required();
  app->add_option("--model", options->model, "An actor file of `doppel export`; without it: pure skinning");
  app->add_option("--format", options->formats, "npy, obj, mp4, or several with commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"npy", "obj", "mp4"}))
      ->capture_default_str();
  app->add_option("--out", options->out, "The folder to write into")->required();
  app->add_option("--bone-rule", options->bone_rule, "Which joint carries a bone: exact or prefix")
      ->check(CLI::IsMember({"exact", "prefix"}))
      ->capture_default_str();
  app->add_option("--video-size", options->turntable.size, "Pixels of the square video")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app->add_option("--turns-per-second", options->turntable.turns_per_second, "How fast the video's camera circles")
      ->capture_default_str();
  app->footer(
      "Example: doppel animate --character actor/actor.character --motion walk.motion --model run/actor.pt "
      "--format npy,mp4 --out walk");
  return {app, [options](const CommonOptions& common) { return run(*options, common); }};
}

}  // namespace doppel::tools
