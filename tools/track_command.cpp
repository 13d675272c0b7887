#include <filesystem>
#include <memory>
#include <string>

#include "doppel/character/character_folder.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/track/shape/place_landmarks.h"
#include "doppel/track/shape/scale_bones.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kTrackExample[] =
    "Examples:\n"
    "  doppel track recordings/anna --surface --out recordings/anna/tracked\n"
    "  doppel prepare recordings/anna/tracked --out prepared/anna\n"
    "  doppel track livecap --help\n"
    "Without a subcommand, the pose is fitted to two or more cameras. CAPTURE needs a calibration, a character and\n"
    "keypoints; masks make the pose follow the outline (docs/tracking.md). Sequences need no motion.\n"
    "The capture.yaml in the output folder names the tracked motions.";

struct MultiviewArguments : TrackArguments {
  bool surface = false;
  bool scale_bones = false;      ///< the bone lengths are fitted first
  bool place_landmarks = false;  ///< their positions on the body are fitted first
};

/// Tracks with the character whose bones have the person's lengths, which is written beside the motions.
TrackReport track_with_scaled_bones(const Footage& footage, const std::string& capture, TrackOptions options) {
  ScaledCharacter scaled = scale_bones(footage, chosen_sequences(footage, options), options.config);
  const std::string& name = scaled.character.name;
  const fs::path written = write_character_folder(
      options.out / "character", name, [&](const fs::path& folder) { write_character(folder, scaled.character); });
  const auto scaled_footage =
      Footage::open_for(load_character(written), written, capture, options.config.fit.outline_pixels);
  options.bone_scales = std::move(scaled.factors);
  return track_capture(*scaled_footage, options);
}

/// Tracks with the landmarks where the detector sees them, which are written beside the motions.
TrackReport track_with_placed_landmarks(const Footage& footage, const std::string& capture,
                                        const TrackOptions& options) {
  const std::vector<Marker> placed = place_landmarks(footage, chosen_sequences(footage, options), options.config);
  const fs::path written = options.out / "landmarks.csv";
  fs::create_directories(options.out);
  write_landmarks(written, footage.character(), placed);
  log::info("landmarks where the detector sees them: {}", written.string());
  return track_capture(*Footage::open_with_landmarks(written, capture, options.config.fit.outline_pixels), options);
}

TrackReport track_with_all_cameras(const MultiviewArguments& choice, const TrackArguments& found) {
  const TrackOptions options{
      found.task, read_track_config(config_document(found)), choice.surface, found.sheet_frames, {}};
  const auto footage = Footage::open(found.capture, options.config.fit.outline_pixels);
  if (choice.scale_bones) return track_with_scaled_bones(*footage, found.capture, options);
  if (choice.place_landmarks) return track_with_placed_landmarks(*footage, found.capture, options);
  return track_capture(*footage, options);
}

int run_multiview(const MultiviewArguments& arguments, const CommonOptions& common) {
  if (arguments.capture.empty())
    fail<UsageError>(
        "the capture is missing: `doppel track CAPTURE` for several cameras, `doppel track livecap CAPTURE` for one; "
        "`doppel track --help` lists the other methods");
  if ((common.shard || !common.merged.empty()) && (arguments.scale_bones || arguments.place_landmarks))
    fail<UsageError>(
        "--shard: --scale and --place-landmarks look at all sequences together; use them in a run without --shard, "
        "and track with the character or the landmarks that it writes");
  return track_sequences(arguments, common, arguments.surface, [&arguments](const TrackArguments& found) {
    return track_with_all_cameras(arguments, found);
  });
}

void add_multiview_options(CLI::App& app, MultiviewArguments& arguments) {
  // Not `required`: CLI11 would then take the word of a subcommand for the capture.
  add_capture_option(app, arguments);
  add_output_options(app, arguments);
  add_sequences_option(app, arguments);
  add_config_options(app, arguments);
  app.add_flag("--surface", arguments.surface,
               "Deform the surface to the masks after the pose; writes SEQUENCE_graph.npy");
  CLI::Option* scale =
      app.add_option_function<std::string>(
             "--scale", [&arguments](const std::string&) { arguments.scale_bones = true; },
             "bones: first find the lengths of the bones over all frames together, for a body that is not quite this "
             "person's; the scaled character is written to OUT/character")
          ->check(CLI::IsMember({"bones"}));
  app.add_flag("--place-landmarks", arguments.place_landmarks,
               "First find where on the body the detector sees its points, over many frames together, for this "
               "person's body and a detector with other joints; the positions are written to OUT/landmarks.csv")
      ->excludes(scale);
  add_vertices_option(app, arguments);
  add_sheet_option(app, arguments);
}

}  // namespace

Command add_track(CLI::App& program) {
  CLI::App* app = program.add_subcommand("track", "Find pose and surface in every frame from keypoints and masks");
  app->footer(kTrackExample);
  app->require_subcommand(0, 1);
  auto arguments = std::make_shared<MultiviewArguments>();
  add_multiview_options(*app, *arguments);
  const auto run = [arguments](const CommonOptions& common) { return run_multiview(*arguments, common); };
  return {app,
          run,
          true,
          {add_track_livecap(*app), add_track_deepcap(*app), add_track_points(*app), add_track_live(*app),
           add_track_refine(*app)}};
}

}  // namespace doppel::tools
