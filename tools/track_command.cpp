#include <fmt/core.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/track/deepcap.h"
#include "doppel/track/live/live_run.h"
#include "doppel/track/live/posenet_joints.h"
#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/method_trackers.h"
#include "doppel/track/track_capture.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kTrackExample[] =
    "Example:\n"
    "  doppel track recordings/anna --method multiview --out recordings/anna/tracked\n"
    "  doppel prepare recordings/anna/tracked --out prepared/anna\n"
    "  doppel track recordings/street --method livecap --vertices\n"
    "  doppel track recordings/street --method deepcap --run runs/anna-street\n"
    "  doppel track recordings/desk --method livecap --source 0 --empty-frames 25 --preview\n"
    "CAPTURE needs a calibration, a character, and keypoints and masks (docs/tracking.md); multiview needs at least "
    "two\n"
    "cameras. Its sequences need no motion: the capture.yaml that is written names the tracked ones.";

struct TrackArguments {
  std::string capture, method = "multiview", config, camera;
  std::vector<std::string> set;
  TrackTask task;
  bool surface = false;
  int sheet_frames = TrackOptions().sheet_frames;
  DeepcapOptions deepcap;  ///< what deepcap alone has
  std::string source, preview, texture;
  SourceOptions playing;
  int empty_frames = 0;

  bool live() const { return !source.empty(); }
};

ConfigDocument config_document(const TrackArguments& arguments) {
  if (arguments.config.empty()) return ConfigDocument::parse("{}", "the defaults", arguments.set);
  return ConfigDocument::load(arguments.config, arguments.set);
}

void print_live(const LiveFigures& live) {
  fmt::print("  {} images of {}, {} dropped; {:.1f} frames/s, latency {:.0f} ms on average, {:.0f} ms at most\n",
             live.images, live.source, live.dropped, live.frames_per_second, live.latency_ms, live.largest_latency_ms);
  fmt::print("  milliseconds a frame: capture {:.1f}, preprocess {:.1f}, detect {:.1f}, pose {:.1f}, surface {:.1f}\n",
             live.capture_ms, live.preprocess_ms, live.detect_ms, live.pose_ms, live.surface_ms);
}

void print_livecap(const LivecapSummary& livecap) {
  fmt::print("  IoU with the masks: {:.4f} of the skinned template, {:.4f} of the surface\n", livecap.posed_overlap,
             livecap.overlap);
  fmt::print("  {:.1f} frames/s with reading; milliseconds a frame: read {:.1f}, pose {:.1f}, surface {:.1f}\n",
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
      fmt::print("  against the given motion: landmarks {:.1f} mm apart on average\n", sequence.difference->mean_mm);
    if (tracked.surface) {
      const SurfaceSummary surface = summarise(*tracked.surface);
      fmt::print("  IoU with the masks: {:.4f} of the skinned template, {:.4f} of the surface, {:.1f} frames/s\n",
                 surface.posed_overlap, surface.overlap, surface.frames_per_second);
    }
    if (sequence.livecap) print_livecap(summarise_livecap(sequence));
    if (sequence.live) print_live(*sequence.live);
    if (!lost.empty()) fmt::print("  lost frames, interpolated from their neighbours: {}\n", fmt::join(lost, ", "));
  }
}

fs::path default_track_out(const fs::path& capture) {
  return (fs::is_directory(capture) ? capture : capture.parent_path()) / "tracked";
}

TrackViewOptions view_options(const TrackArguments& arguments) {
  TrackViewOptions options;
  options.texture = read_texture(arguments.texture);
  return options;
}

std::unique_ptr<Preview> preview_of(const TrackArguments& arguments, const Camera& camera, const Character& character,
                                    double frames_per_second) {
  if (arguments.preview.empty()) return nullptr;
  return open_preview(arguments.preview, camera, character.mesh, frames_per_second, view_options(arguments));
}

void learn_empty_scene(const TrackArguments& arguments, FrameSource& source, LiveView& view) {
  if (arguments.empty_frames == 0) return;
  log::info("learning the empty scene from {} images: nobody may be seen yet", arguments.empty_frames);
  std::vector<cv::Mat> images;
  while (static_cast<int>(images.size()) < arguments.empty_frames) {
    const auto image = source.next();
    if (!image) break;
    images.push_back(image->image);
  }
  view.learn_empty_scene(images);
}

/// Both methods that need one camera, on images as they come.
TrackReport track_source(const TrackArguments& arguments) {
  const bool deepcap = arguments.method == "deepcap";
  const auto source = open_source(arguments.source, arguments.playing);
  const LivecapConfig config = deepcap ? LivecapConfig() : read_livecap_config(config_document(arguments));
  LiveViewOptions seeing;
  seeing.camera = arguments.camera;
  seeing.sequence = arguments.task.sequences.empty() ? "" : arguments.task.sequences.front();
  seeing.outline_pixels = config.fit.outline_pixels;
  seeing.from_camera = is_camera(arguments.source);
  LiveView view(arguments.capture, source->size(), seeing);
  std::optional<TrainedPose> trained;
  if (!arguments.deepcap.run.empty()) trained.emplace(TrainedPose::load(arguments.deepcap.run));
  if (trained && !deepcap) view.find_joints_by(joints_of_posenet(view, *trained));
  const auto tracker =
      deepcap ? make_deepcap_tracker(*trained, view.character(), view.landmarks(), view.camera(), LostFrames::hold)
              : make_livecap_tracker(view.character(), view.landmarks(), view.camera(), config);
  const auto preview = preview_of(arguments, view.camera(), view.character(), source->frames_per_second());
  learn_empty_scene(arguments, *source, view);
  LiveRunOptions options;
  static_cast<TrackTask&>(options) = arguments.task;
  options.method = arguments.method;
  options.filter = !deepcap && config.filter;
  options.smoothing = deepcap ? 0.0 : config.smoothing;
  return track_live(*source, view, *tracker, options, preview.get());
}

TrackReport track_with_one_camera(const TrackArguments& arguments) {
  const LivecapCaptureOptions options{arguments.task, read_livecap_config(config_document(arguments)),
                                      arguments.sheet_frames};
  const auto footage = Footage::open(arguments.capture, options.config.fit.outline_pixels, arguments.camera);
  check_one_camera(*footage);
  const auto preview = preview_of(arguments, footage->cameras().front(), footage->character(), footage->capture().fps);
  return track_livecap(*footage, options, preview.get());
}

TrackReport track_with_networks(const TrackArguments& arguments) {
  DeepcapOptions options = arguments.deepcap;
  static_cast<TrackTask&>(options) = arguments.task;
  options.view = view_options(arguments);
  return track_deepcap(*Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera), options);
}

TrackReport track_with_all_cameras(const TrackArguments& arguments) {
  const TrackOptions options{arguments.task, read_track_config(config_document(arguments)), arguments.surface,
                             arguments.sheet_frames};
  return track_capture(*Footage::open(arguments.capture, options.config.fit.outline_pixels), options);
}

/// What does not go together.
void check(const TrackArguments& arguments) {
  const bool livecap = arguments.method == "livecap", deepcap = arguments.method == "deepcap";
  if ((livecap || deepcap) && arguments.surface)
    fail<UsageError>(
        "--surface belongs to --method multiview; livecap tracks the surface always, unless the "
        "configuration says `surface: {{enabled: false}}`, and deepcap where DefNet was trained");
  if (!livecap && !deepcap && !arguments.camera.empty())
    fail<UsageError>("--camera belongs to livecap and deepcap; the multi-view fit takes all cameras of the capture");
  if (!livecap && !deepcap && (arguments.live() || !arguments.preview.empty() || !arguments.texture.empty()))
    fail<UsageError>("--source, --preview and --texture belong to livecap and deepcap, which look through one camera");
  if (deepcap && arguments.deepcap.run.empty())
    fail<UsageError>("--method deepcap needs --run RUN: what `doppel train` or `doppel adapt` wrote");
  if (deepcap && (!arguments.config.empty() || !arguments.set.empty()))
    fail<UsageError>("--config and --set belong to the methods that fit; deepcap has the configuration of its run");
  if (!deepcap && !arguments.deepcap.run.empty() && !(livecap && arguments.live()))
    fail<UsageError>(
        "--run belongs to --method deepcap, or to livecap with --source, where its PoseNet places joints in space");
  if (!arguments.live() && (arguments.empty_frames > 0 || arguments.playing.live || arguments.playing.repeat > 1))
    fail<UsageError>("--empty-frames, --live and --repeat belong to --source");
  if (deepcap && !arguments.live() && !arguments.preview.empty())
    fail<UsageError>("deepcap writes SEQUENCE.mp4 by itself; --preview belongs to livecap, or to --source");
  if (!arguments.texture.empty() && arguments.preview.empty() && (livecap || arguments.live()))
    fail<UsageError>("--texture is drawn in the preview: give --preview too");
}

int run(TrackArguments arguments, const CommonOptions& common) {
  check(arguments);
  TrackTask& task = arguments.task;
  if (task.out.empty()) task.out = default_track_out(arguments.capture);
  const TrackReport report = arguments.live()                ? track_source(arguments)
                                        : arguments.method == "livecap" ? track_with_one_camera(arguments)
                                        : arguments.method == "deepcap" ? track_with_networks(arguments)
                                                                        : track_with_all_cameras(arguments);
  if (common.json)
    fmt::print("{}\n", to_json(report).dump(2));
  else
    print_table(report);
  if (arguments.live())
    log::info("results in {}", task.out.string());
  else
    log::info("motions in {}; next: doppel prepare {}", task.out.string(), task.out.string());
  return 0;
}

}  // namespace

Command add_track(CLI::App& program) {
  CLI::App* app = program.add_subcommand("track", "Find the person's pose in every frame from keypoints and masks");
  app->footer(kTrackExample);
  auto arguments = std::make_shared<TrackArguments>();
  TrackTask& task = arguments->task;
  app->add_option("capture", arguments->capture, "Capture folder, its capture.yaml, or a prepared folder")->required();
  app->add_option("--method", arguments->method,
                  "multiview: a fit to all cameras; livecap: a fit to one; deepcap: trained networks that see one")
      ->check(CLI::IsMember({"multiview", "livecap", "deepcap"}))
      ->capture_default_str();
  app->add_option("--out", task.out, "Folder to write into (default: CAPTURE/tracked)");
  app->add_option("--sequences", task.sequences, "Names of the sequences to track (default: all)")->delimiter(',');
  app->add_option("--limit-frames", task.limit_frames, "Only so many frames of each sequence (0: all)")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app->add_option("--config", arguments->config, "Weights and thresholds (configs/track/multiview.yaml, livecap.yaml)");
  app->add_option("--camera", arguments->camera,
                  "The camera to track with (livecap, deepcap), where the capture has several");
  app->add_option("--set", arguments->set, "Override one of them: --set silhouette.weight=0");
  app->add_flag("--surface", arguments->surface, "Bend the surface to the masks after the pose: SEQUENCE_graph.npy");
  app->add_flag("--vertices", task.vertices, "Write SEQUENCE_vertices.npy too: the surface, skinned or bent");
  app->add_option("--sheet-frames", arguments->sheet_frames, "Frames on the contact sheet SEQUENCE.jpg (0: none)")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  DeepcapOptions& deepcap = arguments->deepcap;
  app->add_option("--run", deepcap.run,
                  "deepcap: a run of PoseNet, or of PoseNet and DefNet; livecap with --source: PoseNet places joints");
  app->add_option("--smoothing", deepcap.smoothing, "deepcap: sigma over five frames, in frames (0: none)")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  app->add_flag("!--no-film", deepcap.film, "deepcap: without SEQUENCE.mp4, the surface over the images");
  app->add_option(
      "--source", arguments->source,
      "livecap, deepcap: images as they come instead of the capture's: a camera (0, 1, ...), a video or a "
      "folder of images; the capture says what stands around them");
  app->add_option("--empty-frames", arguments->empty_frames, "The first images of the source show the empty scene")
      ->check(CLI::Range(0, 1000));
  app->add_flag("--live", arguments->playing.live,
                "A file as the source comes at its own rate, and may be dropped from");
  app->add_option("--repeat", arguments->playing.repeat, "How often a file as the source is played")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  const CLI::Option* preview =
      app->add_option(
             "--preview", arguments->preview,
             "Show the surface over the image and from the side: in a window (keys a, d turn; q ends), or into "
             "an .mp4 file where there is no screen")
          ->expected(0, 1)
          ->type_name("[FILE.mp4]");
  app->add_option("--texture", arguments->texture,
                  "An image that the surface wears in the preview, or in deepcap's film");
  return {app, [arguments, preview](const CommonOptions& common) {
            if (preview->count() > 0 && arguments->preview.empty()) arguments->preview = "window";
            return run(*arguments, common);
          }};
}

}  // namespace doppel::tools
