#include "track_methods.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "doppel/character/motion.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/track/track_results.h"
#include "number_checks.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

void print_live(const LiveFigures& live) {
  fmt::print("  {} images of {}, {} dropped; {:.1f} frames/s, latency {:.0f} ms on average, {:.0f} ms at most\n",
             live.images, live.source, live.dropped, live.frames_per_second, live.latency_ms, live.largest_latency_ms);
  fmt::print(
      "  milliseconds per frame: capture {:.1f}, preprocess {:.1f}, detect {:.1f}, pose {:.1f}, surface {:.1f}\n",
      live.capture_ms, live.preprocess_ms, live.detect_ms, live.pose_ms, live.surface_ms);
}

void print_livecap(const LivecapSummary& livecap, bool has_overlaps) {
  if (has_overlaps)
    fmt::print("  IoU with the masks: {:.4f} of the skinned template, {:.4f} of the surface\n", livecap.posed_overlap,
               livecap.overlap);
  fmt::print("  {:.1f} frames/s with reading; milliseconds per frame: read {:.1f}, pose {:.1f}, surface {:.1f}\n",
             livecap.frames_per_second, livecap.read_ms, livecap.pose_ms, livecap.surface_ms);
}

void print_table(const TrackReport& report) {
  fmt::print("{:<16} {:>7} {:>6} {:>10} {:>14} {:>9}\n", "sequence", "frames", "lost", "recovered", "keypoints (px)",
             "frames/s");
  for (const SequenceReport& sequence : report.sequences) {
    const TrackedSequence& tracked = sequence.tracked;
    const std::vector<long> lost = sequence.lost_frames();
    fmt::print("{:<16} {:>7} {:>6} {:>10} {:>14.2f} {:>9.1f}\n", tracked.sequence.name, tracked.frames.size(),
               lost.size(), tracked.count(FrameState::recovered), sequence.keypoint_error(),
               sequence.frames_per_second());
    if (sequence.difference)
      fmt::print("  compared with the given motion: mean distance of landmarks {:.1f} mm\n",
                 sequence.difference->landmarks_mm);
    if (tracked.surface) {
      const SurfaceSummary surface = summarise(*tracked.surface);
      fmt::print("  IoU with the masks: {:.4f} of the skinned template, {:.4f} of the surface, {:.1f} frames/s\n",
                 surface.posed_overlap, surface.overlap, surface.frames_per_second);
    }
    if (sequence.livecap) print_livecap(summarise_livecap(sequence), !sequence.livecap->empty());
    if (sequence.live) print_live(*sequence.live);
    if (!lost.empty()) fmt::print("  lost frames (bridged from their neighbours): {}\n", fmt::join(lost, ", "));
  }
}

fs::path default_track_out(const fs::path& capture) {
  return (fs::is_directory(capture) ? capture : capture.parent_path()) / "tracked";
}

/// @throws UsageError when options stand before the word of the method
void check_nothing_before(const std::string& method, const std::vector<CLI::Option*>& options) {
  for (const CLI::Option* option : options)
    if (option->count() > 0)
      fail<UsageError>(
          "{} stands before the word {}; write `doppel track {} CAPTURE` and its options after that, or ./{} for a "
          "folder of this name",
          option->get_positional() ? option->as<std::string>() : option->get_name(), method, method, method);
}

}  // namespace

CLI::App* add_track_method(CLI::App& track, const std::string& name, const std::string& description,
                           TrackArguments& arguments) {
  CLI::App* app = track.add_subcommand(name, description);
  std::vector<CLI::Option*> before =
      track.get_options([&](const CLI::Option* option) { return option != track.get_help_ptr(); });
  app->preparse_callback([name, before](std::size_t) { check_nothing_before(name, before); });
  add_capture_option(*app, arguments)->required();
  add_output_options(*app, arguments);
  return app;
}

CLI::Option* add_capture_option(CLI::App& app, TrackArguments& arguments) {
  return app.add_option("capture", arguments.capture, "Capture folder, its capture.yaml, or a prepared capture");
}

void add_output_options(CLI::App& app, TrackArguments& arguments) {
  app.add_option("--out", arguments.task.out, "Folder to write into (default: CAPTURE/tracked)");
  app.add_option("--limit-frames", arguments.task.limit_frames, "Largest number of frames of each sequence (0: all)")
      ->check(not_negative())
      ->capture_default_str();
}

void add_sequences_option(CLI::App& app, TrackArguments& arguments) {
  app.add_option("--sequences", arguments.task.sequences, "Names of the sequences to track, with commas (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
}

void add_vertices_option(CLI::App& app, TrackArguments& arguments) {
  app.add_flag("--vertices", arguments.task.vertices,
               "Write SEQUENCE_vertices.npy too: the surface, skinned or deformed");
}

void add_sheet_option(CLI::App& app, TrackArguments& arguments) {
  app.add_option("--sheet-frames", arguments.sheet_frames, "Frames on the contact sheet SEQUENCE.jpg (0: none)")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
}

void add_camera_option(CLI::App& app, TrackArguments& arguments) {
  app.add_option("--camera", arguments.camera, "Name of the camera, if the capture has several");
}

std::vector<CLI::Option*> add_config_options(CLI::App& app, TrackArguments& arguments) {
  return {
      app.add_option("--config", arguments.config, "Configuration of weights and thresholds (keys: docs/tracking.md)"),
      app.add_option("--set", arguments.set, "Override a key of the configuration: --set silhouette.weight=0")
          ->allow_extra_args(false)};
}

CLI::Option* add_prior_motion_option(CLI::App& app, TrackArguments& arguments) {
  return app.add_option("--prior-motion", arguments.prior_motion,
                        "A motion of the same character, for example the studio's; the poses usual in it are more "
                        "probable");
}

void add_preview_options(CLI::App& app, TrackArguments& arguments) {
  CLI::Option* preview =
      app.add_option_function<std::string>(
             "--preview", [&arguments](const std::string& file) { arguments.preview = file.empty() ? "window" : file; },
             "Show the surface over the image and from the side: in a window (keys a and d rotate, q ends), or in an "
             ".mp4 file if there is no screen")
          ->expected(0, 1)
          ->type_name("[FILE.mp4]");
  app.add_option("--texture", arguments.texture, "Texture image for the surface in the preview")->needs(preview);
}

ConfigDocument config_document(const TrackArguments& arguments) {
  if (arguments.config.empty()) return ConfigDocument::parse("{}", "the defaults", arguments.set);
  return ConfigDocument::load(arguments.config, arguments.set);
}

void add_prior_motion(LivecapConfig& config, const TrackArguments& arguments, const Character& character) {
  if (arguments.prior_motion.empty()) return;
  config.fit.usual_poses = read_motion(arguments.prior_motion, character.skeleton.num_dofs()).frames;
}

TrackViewOptions view_options(const TrackArguments& arguments) {
  TrackViewOptions options;
  options.texture = read_texture(arguments.texture);
  return options;
}

std::unique_ptr<Preview> preview_of(const TrackArguments& arguments, const PinholeCamera& camera,
                                    const Character& character, double frames_per_second) {
  if (arguments.preview.empty()) return nullptr;
  return open_preview(arguments.preview, camera, character.mesh, frames_per_second, view_options(arguments));
}

FolderLock begin_track(TrackArguments& arguments, const CommonOptions& common) {
  if ((common.shard || !common.merged.empty()) && lacks_keypoints(arguments.capture))
    fail<UsageError>(
        "--shard: {} names no keypoints, and each shard would detect those of all sequences; run "
        "`doppel detect` first, which knows --shard too, and track its result",
        arguments.capture);
  TrackTask& task = arguments.task;
  if (task.out.empty() && !common.shard) task.out = default_track_out(arguments.capture);
  task.shard = common.shard;
  begin_work(common, task.out, [&] { return capture_inputs(find_capture(arguments.capture)); });
  return FolderLock(task.out);
}

void find_keypoints(TrackArguments& arguments, const DetectNeeds& needs, const CommonOptions& common) {
  arguments.capture = with_keypoints(arguments.capture, arguments.task.out / "detected", needs, common).string();
}

int finish_track(const TrackReport& report, const TrackArguments& arguments, const CommonOptions& common,
                 const std::string& results) {
  if (!is_stopped(report)) finish_work(common, arguments.task.out, nullptr);
  if (common.json)
    fmt::print("{}\n", to_json(report).dump(2));
  else
    print_table(report);
  log::info("{}", results);
  if (!is_stopped(report)) return 0;
  log::warn("the last sequence was not tracked to its end; the same command tracks all again");
  return 1;
}

int track_sequences(TrackArguments arguments, const CommonOptions& common, bool needs_masks,
                    const std::function<TrackReport(const TrackArguments&)>& track) {
  const FolderLock lock = begin_track(arguments, common);
  if (!common.merged.empty()) {
    const auto footage = Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera);
    merge_tracks(*footage, arguments.task, common.merged.folders);
    return 0;
  }
  find_keypoints(arguments, {needs_masks, true}, common);
  const std::string out = arguments.task.out.string();
  return finish_track(track(arguments), arguments, common,
                      fmt::format("motions in {}; next: doppel prepare {}", out, out));
}

}  // namespace doppel::tools
