#include "animate_performer.h"

#include <filesystem>

#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/core/error.h"
#include "doppel/render/splats/splat_rows.h"
#include "doppel/render/splats/splats.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

/// @throws UsageError for a run that captures poses from images; the message names the right command
void refuse_pose_run(const char* option, const std::string& path) {
  if (captures_poses(path))
    fail<UsageError>("{} {}: this run takes images of a person, not a motion; use it with `doppel track deepcap`",
                     option, path);
}

/// An actor file. @throws UsageError for a run
ActorFile load_model(const std::string& path) {
  refuse_pose_run("--model", path);
  if (fs::exists(RunFolder(path).config()))
    fail<UsageError>("--model {}: this is a run; `doppel export --run {}` writes the actor file that --model needs",
                     path, path);
  return ActorFile::load(path);
}

/// Checks that a file has the Gaussians that are to be drawn. @throws UsageError without
void check_renderer(const AnimateOptions& options, const std::optional<ActorFile>& file) {
  if (options.renderer != "gaussians") return;
  if (!file)
    fail<UsageError>("--renderer gaussians: a character alone has none; give --run RUN, or --model FILE of such a run");
  if (file->description().num_gaussians == 0)
    fail<UsageError>(
        "--renderer gaussians: {} holds none; export a run whose stage gaussians is trained, without --geometry-only",
        options.model);
}

}  // namespace

LookFunction Performer::texture() const {
  if (file && file->description().texture_size > 0)
    return [actor = &*file](const auto& window, const auto& projection, const auto& vertices) {
      return actor->texture(window, projection, vertices);
    };
  if (trained && trained->texnet)
    return [actor = trained.get()](const auto& window, const auto& projection, const auto& vertices) {
      return actor->texture(window, projection, vertices);
    };
  return nullptr;
}

SplatFunction Performer::splats() const {
  if (file && file->description().num_gaussians > 0)
    return [actor = &*file](const auto& window, const auto& projection, const auto& vertices) {
      return splats_of_rows(actor->gaussians(window, projection, vertices));
    };
  if (trained && trained->gaussians)
    return [actor = trained.get()](const auto& window, const auto& projection, const auto& vertices) {
      return actor->splats(window, projection, vertices);
    };
  return nullptr;
}

FieldFunction Performer::field(const std::string& renderer) const {
  TrainedActor* const actor = trained.get();
  if (renderer == "radiance")
    return [actor](const auto& window, const auto& projection, const auto&, std::int64_t height, std::int64_t width) {
      return actor->radiance(window, projection, height, width);
    };
  if (renderer == "gaussians")
    return [splats = splats()](const auto& window, const auto& projection, const auto& vertices, std::int64_t height,
                               std::int64_t width) {
      const torch::Tensor camera = projection.unsqueeze(0);
      const SplatImage drawn = draw_splats(splats(window, camera, vertices), camera.unsqueeze(1), height, width);
      return FieldImage{drawn.colour[0][0], drawn.alpha[0][0], {}};
    };
  return nullptr;
}

std::optional<double> Performer::frames_per_second() const {
  if (file) return file->description().frames_per_second;
  if (trained) return trained->frames_per_second;
  return std::nullopt;
}

Performer make_performer(const AnimateOptions& options) {
  Performer performer;
  if (!options.run.empty()) {
    refuse_pose_run("--run", options.run);
    performer.trained = std::make_unique<TrainedActor>(TrainedActor::load(options.run));
    if (options.renderer == "radiance" && !performer.trained->hybrid)
      fail(
          "{} has no checkpoint of the stage radiance; train it first: doppel train configs/small/hybrid.yaml --set "
          "ddc={}",
          options.run, options.run);
    if (options.renderer == "gaussians" && !performer.trained->gaussians)
      fail(
          "{} has no checkpoint of the stage gaussians; train it first: doppel train configs/small/gaussians.yaml "
          "--set capture=PREPARED --set ddc={} --out NEW",
          options.run, options.run);
    performer.character = performer.trained->character;
    return performer;
  }
  if (options.renderer == "radiance")
    fail<UsageError>("--renderer radiance requires --run RUN: only a run has a radiance field");
  if (options.character.empty())
    fail<UsageError>("the actor is missing: give --character FILE, perhaps with --model, or --run RUN");
  CharacterOptions character_options;
  character_options.bone_rule = options.bone_rule == "prefix" ? BoneRule::prefix : BoneRule::exact;
  performer.character = load_character(options.character, character_options);
  if (!options.model.empty()) performer.file = load_model(options.model);
  check_renderer(options, performer.file);
  return performer;
}

void perform(const AnimateOptions& options, const Performer& performer, std::span<const MotionPart> parts,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile& profile) {
  TrainedActor* actor = performer.trained.get();
  if (!actor)
    return animate(performer.character, parts, performer.file ? &*performer.file : nullptr, writers, &profile);
  const bool radiance = options.renderer == "radiance";
  animate(
      performer.character, parts, actor->past_frames(),
      [actor, radiance](const torch::Tensor& windows) {
        return radiance ? actor->refined(windows) : actor->fine(windows);
      },
      writers, &profile);
}

}  // namespace doppel::tools
