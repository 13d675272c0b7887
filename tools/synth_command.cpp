#include <fmt/core.h>

#include <charconv>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/synth/synth.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

/// Options of the command line; missing values are those of the preset.
struct SynthArguments {
  std::string out, preset = "tiny", cloth, lens = "pinhole", body = synth::kOwnBody;
  std::vector<std::string> motions, test_motions;
  int cameras = 0, frames = 0, test_frames = 0, size = 0;
  double turn = 0.0;
  std::string seed = "1";
  bool force = false;
};

/// @throws UsageError for a word that is no number, has a sign, or does not fit
std::uint64_t seed_of(const std::string& word) {
  std::uint64_t seed = 0;
  const char* end = word.data() + word.size();
  const auto [rest, error] = std::from_chars(word.data(), end, seed);
  if (error != std::errc() || rest != end)
    fail<UsageError>("--seed is '{}'; it must be a whole number from 0 to {}", word,
                     std::numeric_limits<std::uint64_t>::max());
  return seed;
}

synth::SynthOptions options_of(const SynthArguments& arguments, const CLI::App& app, const CommonOptions& common) {
  synth::SynthOptions options = synth::SynthOptions::preset(arguments.preset);
  const auto take = [&](const char* name, int given, int& value) {
    if (app.count(name) > 0) value = given;
  };
  take("--cameras", arguments.cameras, options.cameras);
  take("--frames", arguments.frames, options.frames);
  take("--test-frames", arguments.test_frames, options.test_frames);
  take("--size", arguments.size, options.size);
  if (!arguments.cloth.empty()) options.cloth.model = synth::cloth_model(arguments.cloth);
  options.clips.assign(arguments.motions.begin(), arguments.motions.end());
  options.test_clips.assign(arguments.test_motions.begin(), arguments.test_motions.end());
  options.lens = synth::synth_lens(arguments.lens);
  options.body = arguments.body;
  options.turn = arguments.turn;
  options.seed = seed_of(arguments.seed);
  options.force = arguments.force;
  options.threads = resolve_threads(common.threads);
  options.shard = common.shard;
  options.shards = common.merged.folders;
  return options;
}

void print_summary(const std::string& out, const synth::SynthOptions& o, const synth::SynthReport& r) {
  fmt::print("synthetic capture in {}\n", out);
  if (o.body != synth::kOwnBody) fmt::print("  body      {}\n", o.body);
  fmt::print("  actor     {} vertices, {} faces, {} graph nodes, {} DoFs\n", r.vertices, r.faces, r.nodes, r.dofs);
  fmt::print("  cameras   {}, {} x {} pixels\n", o.cameras, o.size, o.size);
  fmt::print("  frames    {} for training in {} takes, {} for testing, {} per second\n", r.frames, r.takes,
             r.test_frames, o.fps);
  fmt::print("  clothes   {}, {:.1f} mm from the skinned template on average, {:.1f} mm at most (test frames)\n",
             synth::cloth_name(o.cloth.model), 1e3 * r.mean_displacement, 1e3 * r.largest_displacement);
  fmt::print("  skinning  silhouettes overlap with the ground truth by IoU {:.4f} (test frames, all cameras)\n",
             r.skinning_iou);
  fmt::print("next: doppel prepare {}\n", out);
}

void print_json(const std::string& out, const synth::SynthOptions& o, const synth::SynthReport& r) {
  const nlohmann::json result = {{"capture", out},
                                 {"vertices", r.vertices},
                                 {"faces", r.faces},
                                 {"nodes", r.nodes},
                                 {"dofs", r.dofs},
                                 {"cameras", o.cameras},
                                 {"size", o.size},
                                 {"fps", o.fps},
                                 {"body", o.body},
                                 {"seed", o.seed},
                                 {"cloth", synth::cloth_name(o.cloth.model)},
                                 {"lens", o.lens == Lens::fisheye ? "fisheye" : "pinhole"},
                                 {"turn", o.turn},
                                 {"frames", {{"train", r.frames}, {"test", r.test_frames}}},
                                 {"takes", r.takes},
                                 {"mean_displacement_mm", 1e3 * r.mean_displacement},
                                 {"largest_displacement_mm", 1e3 * r.largest_displacement},
                                 {"skinning_iou", r.skinning_iou}};
  fmt::print("{}\n", result.dump(2));
}

/// What a shard hands to the merge: the checksums of the surfaces that it filmed.
nlohmann::ordered_json surfaces_of(const std::filesystem::path& folder) {
  nlohmann::ordered_json sums;
  for (const char* sequence : {"training", "testing"})
    sums[sequence] = checksum_of(folder / "ground_truth" / sequence / "vertices.npy");
  return sums;
}

/// @throws UsageError when shards have filmed other surfaces than the first
void check_surfaces(const ShardSet& shards) {
  for (std::size_t i = 1; i < shards.files.size(); ++i)
    if (shards.files[i].results != shards.files[0].results)
      fail<UsageError>(
          "{} and {} have simulated different surfaces, as machines with other processors may do; make all shards with "
          "the same DOPPEL_ISA (plain, avx2 or avx512)",
          shards.folders[0].string(), shards.folders[i].string());
}

int run(const SynthArguments& arguments, const CLI::App& app, const CommonOptions& common) {
  const synth::SynthOptions options = options_of(arguments, app, common);
  synth::check_options(options);
  check_surfaces(common.merged);
  begin_work(common, arguments.out, [] { return std::vector<std::string>(); });
  const std::optional<synth::SynthReport> report = synth::write_synthetic_capture(arguments.out, options);
  if (!report) {
    log::warn("stopped; the same command goes on with the takes and cameras that are missing");
    return 1;
  }
  finish_work(common, arguments.out, common.shard ? surfaces_of(arguments.out) : nullptr);
  if (!common.merged.empty()) return 0;
  if (common.shard)
    log::info("shard {} of the capture in {}; join the shards with `doppel merge`", common.shard->to_string(),
              arguments.out);
  else
    common.json ? print_json(arguments.out, options, *report) : print_summary(arguments.out, options, *report);
  return 0;
}

}  // namespace

Command add_synth(CLI::App& program) {
  CLI::App* app =
      program.add_subcommand("synth", "Make a synthetic capture: a character, cameras, videos, masks, ground truth");
  app->footer(
      "Examples:\n"
      "  doppel synth --out captures/tiny --preset tiny\n"
      "  doppel synth --out captures/walk --preset small --frames 0 --motion walk.bvh");
  auto arguments = std::make_shared<SynthArguments>();
  app->add_option("--out", arguments->out, "The capture folder to make")->required();
  app->add_option("--preset", arguments->preset,
                  "tiny (seconds to make), small (a minute or two) or studio (half an hour: 3000 frames of varied "
                  "movements, 12 cameras)")
      ->capture_default_str();
  app->add_option("--cameras", arguments->cameras, "Number of cameras, instead of the preset's");
  app->add_option("--frames", arguments->frames, "Number of generated training frames, instead of the preset's");
  app->add_option("--test-frames", arguments->test_frames, "Number of generated test frames, instead of the preset's");
  app->add_option("--size", arguments->size, "Side of the square images in pixels, instead of the preset's");
  app->add_option("--motion", arguments->motions,
                  "A motion of any body for training, beside the generated ones: .bvh, .glb, .fbx, .npz, .c3d, ... "
                  "(as in doppel animate). May be repeated; --frames 0 leaves only these");
  app->add_option("--test-motion", arguments->test_motions, "The same for testing");
  app->add_option("--lens", arguments->lens, "pinhole, or fisheye: action cameras near the person")
      ->capture_default_str();
  app->add_option("--cloth", arguments->cloth,
                  "Simulation of the clothes: springs (fast), or xpbd (near-inextensible, touches the body; half a "
                  "minute longer for small). Default: xpbd for studio, springs for the others");
  app->add_option("--body", arguments->body, "Whose body: actor, average, or random:SEED, e.g. random:7")
      ->capture_default_str();
  app->add_option("--turn", arguments->turn,
                  "Mean speed at which the person turns, degrees per second (-360 to 360); not with studio")
      ->capture_default_str();
  app->add_option("--seed", arguments->seed, "Seed of motions, cameras and noise")
      ->capture_default_str()
      ->type_name("UINT");
  app->add_flag("--force", arguments->force,
                "Replace a synthetic capture in the folder, and remove an unfinished one of other options");
  return {app, [app, arguments](const CommonOptions& common) { return run(*arguments, *app, common); }, true};
}

}  // namespace doppel::tools
