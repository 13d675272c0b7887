#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "detected_capture.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/landmarks.h"
#include "doppel/character/motion.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/io/vmc/vmc_sender.h"
#include "doppel/track/deepcap/deepcap.h"
#include "doppel/track/live/live_run.h"
#include "doppel/track/live/posenet_joints.h"
#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/method_trackers.h"
#include "doppel/track/points/track_points.h"
#include "doppel/track/shape/place_landmarks.h"
#include "doppel/track/shape/scale_bones.h"
#include "doppel/track/track_capture.h"
#include "doppel/track/track_results.h"
#include "doppel/view/view_sender.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kTrackExample[] =
    "Example:\n"
    "  doppel track recordings/anna --method multiview --out recordings/anna/tracked\n"
    "  doppel prepare recordings/anna/tracked --out prepared/anna\n"
    "  doppel track recordings/anna --method points\n"
    "  doppel track recordings/street --method livecap --vertices\n"
    "  doppel track recordings/street --method deepcap --run runs/anna-street\n"
    "  doppel track recordings/desk --method livecap --source 0 --empty-frames 25 --preview\n"
    "  doppel track recordings/street --method livecap --source street.mp4 --detect\n"
    "  doppel track recordings/desk --method livecap --source 0 --detect --send vmc://127.0.0.1:39539\n"
    "CAPTURE needs a calibration, a character and keypoints; masks make the pose follow the outline\n"
    "(docs/tracking.md). multiview needs at least two cameras. points needs no character. Sequences need no motion.\n"
    "The capture.yaml in the output folder names the tracked motions.";

struct TrackArguments {
  std::string capture, method = "multiview", config, camera;
  std::vector<std::string> set;
  TrackTask task;
  bool surface = false;
  int sheet_frames = TrackOptions().sheet_frames;
  DeepcapOptions deepcap;  ///< options of deepcap alone
  std::string source, preview, texture, send;
  std::string prior_motion;  ///< file of poses that the person usually takes; empty: none
  SourceOptions playing;
  int empty_frames = 0;
  std::string detect;            ///< a model of BlazePose; empty: evidence as the capture says
  std::string scale;             ///< "bones": the bone lengths are fitted first; empty: the character as it is
  bool place_landmarks = false;  ///< their places on the body are fitted first

  bool looks_at_all_frames_first() const { return !scale.empty() || place_landmarks; }
  bool live() const { return !source.empty(); }
  bool needs_masks() const { return method == "livecap" || method == "deepcap" || surface; }
};

ConfigDocument config_document(const TrackArguments& arguments) {
  if (arguments.config.empty()) return ConfigDocument::parse("{}", "the defaults", arguments.set);
  return ConfigDocument::load(arguments.config, arguments.set);
}

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

void print_points(const TrackPointsReport& report) {
  for (const TrackedPoints& tracked : report.sequences) {
    const PointMotion& motion = tracked.motion;
    fmt::print("{}: {} frames, {} points, {:.1f} % found, {} filled\n", tracked.sequence, motion.frames.size(),
               motion.points.size(), 100.0 * motion.found(), motion.filled);
    fmt::print("  {:<16} {:>9} {:>12} {:>14}\n", "camera", "points", "agreeing (%)", "residual (px)");
    for (const PointCamera& camera : motion.cameras)
      fmt::print("  {:<16} {:>9} {:>12.1f} {:>14.2f}\n", camera.name, camera.seen,
                 100.0 * static_cast<double>(camera.agreeing) / static_cast<double>(std::max(1L, camera.seen)),
                 camera.residual_px);
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

std::unique_ptr<Preview> preview_of(const TrackArguments& arguments, const PinholeCamera& camera,
                                    const Character& character, double frames_per_second) {
  if (arguments.preview.empty()) return nullptr;
  return open_preview(arguments.preview, camera, character.mesh, frames_per_second, view_options(arguments));
}

void learn_empty_scene(const TrackArguments& arguments, FrameSource& source, LiveView& view) {
  if (arguments.empty_frames == 0) return;
  log::info("learning the empty scene from {} images; no person may be in view yet", arguments.empty_frames);
  std::vector<cv::Mat> images;
  while (static_cast<int>(images.size()) < arguments.empty_frames) {
    const auto image = source.next();
    if (!image) break;
    images.push_back(image->image);
  }
  view.learn_empty_scene(images);
}

/// Sends poses to a viewer or to an avatar program, as the address says.
std::function<void(const std::vector<double>&, double, bool)> sending_to(const std::string& address,
                                                                         const Character& character) {
  if (ViewSender::recognises(address))
    return [sender = std::make_shared<ViewSender>(address)](const auto& dofs, double, bool tracked) {
      sender->send(dofs, tracked);
    };
  return [sender = std::make_shared<VmcSender>(address, character)](const auto& dofs, double seconds, bool tracked) {
    sender->send(dofs, seconds, tracked);
  };
}

/// With the poses that the person usually takes, if a file of them was given.
LivecapConfig with_prior_motion(LivecapConfig config, const TrackArguments& arguments, const Character& character) {
  if (!arguments.prior_motion.empty())
    config.fit.usual_poses = read_motion(arguments.prior_motion, character.skeleton.num_dofs()).frames;
  return config;
}

/// Tracks live images with one of the methods for one camera.
TrackReport track_source(const TrackArguments& arguments) {
  const bool deepcap = arguments.method == "deepcap";
  const auto source = open_source(arguments.source, arguments.playing);
  const LivecapConfig config = deepcap ? LivecapConfig() : read_livecap_config(config_document(arguments));
  LiveViewOptions seeing;
  seeing.camera = arguments.camera;
  seeing.sequence = arguments.task.sequences.empty() ? "" : arguments.task.sequences.front();
  seeing.outline_pixels = config.fit.outline_pixels;
  seeing.from_camera = is_camera(arguments.source);
  if (!arguments.detect.empty()) seeing.blazepose = parse_blazepose_model(arguments.detect);
  LiveView view(arguments.capture, source->size(), seeing);
  std::optional<TrainedPose> trained;
  if (!arguments.deepcap.run.empty()) trained.emplace(TrainedPose::load(arguments.deepcap.run));
  if (trained && !deepcap) view.find_joints_by(joints_of_posenet(view, *trained));
  const auto tracker =
      deepcap ? make_deepcap_tracker(*trained, view.character(), view.landmarks(), view.camera(), LostFrames::hold)
              : make_livecap_tracker(view.character(), view.landmarks(), view.camera(),
                                     with_prior_motion(config, arguments, view.character()));
  const auto preview = preview_of(arguments, view.camera(), view.character(), source->frames_per_second());
  learn_empty_scene(arguments, *source, view);
  LiveRunOptions options;
  static_cast<TrackTask&>(options) = arguments.task;
  options.method = arguments.method;
  options.filter = !deepcap && config.filter;
  options.smoothing = deepcap ? 0.0 : config.smoothing;
  if (!arguments.send.empty()) options.on_pose = sending_to(arguments.send, view.character());
  return track_live(*source, view, *tracker, options, preview.get());
}

TrackReport track_with_one_camera(const TrackArguments& arguments) {
  LivecapCaptureOptions options{arguments.task, read_livecap_config(config_document(arguments)),
                                arguments.sheet_frames};
  const auto footage = Footage::open(arguments.capture, options.config.fit.outline_pixels, arguments.camera);
  check_one_camera(*footage);
  options.config = with_prior_motion(std::move(options.config), arguments, footage->character());
  const auto preview = preview_of(arguments, footage->cameras().front(), footage->character(), footage->capture().fps);
  return track_livecap(*footage, options, preview.get());
}

TrackReport track_with_networks(const TrackArguments& arguments) {
  DeepcapOptions options = arguments.deepcap;
  static_cast<TrackTask&>(options) = arguments.task;
  options.view = view_options(arguments);
  return track_deepcap(*Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera), options);
}

/// Tracks with the character whose bones have the person's lengths, which is written beside the motions.
TrackReport track_with_scaled_bones(const Footage& footage, const TrackArguments& arguments, TrackOptions options) {
  ScaledCharacter scaled = scale_bones(footage, chosen_sequences(footage, options), options.config);
  const std::string& name = scaled.character.name;
  const fs::path written = write_character_folder(
      options.out / "character", name, [&](const fs::path& folder) { write_character(folder, scaled.character); });
  const auto scaled_footage =
      Footage::open_for(load_character(written), written, arguments.capture, options.config.fit.outline_pixels);
  options.bone_scales = std::move(scaled.factors);
  return track_capture(*scaled_footage, options);
}

/// Tracks with the landmarks where the detector sees them, which are written beside the motions.
TrackReport track_with_placed_landmarks(const Footage& footage, const TrackArguments& arguments,
                                        const TrackOptions& options) {
  const std::vector<Marker> placed = place_landmarks(footage, chosen_sequences(footage, options), options.config);
  const fs::path written = options.out / "landmarks.csv";
  fs::create_directories(options.out);
  write_landmarks(written, footage.character(), placed);
  log::info("landmarks where the detector sees them: {}", written.string());
  return track_capture(*Footage::open_with_landmarks(written, arguments.capture, options.config.fit.outline_pixels),
                       options);
}

TrackReport track_with_all_cameras(const TrackArguments& arguments) {
  const TrackOptions options{
      arguments.task, read_track_config(config_document(arguments)), arguments.surface, arguments.sheet_frames, {}};
  const auto footage = Footage::open(arguments.capture, options.config.fit.outline_pixels);
  if (!arguments.scale.empty()) return track_with_scaled_bones(*footage, arguments, options);
  if (arguments.place_landmarks) return track_with_placed_landmarks(*footage, arguments, options);
  return track_capture(*footage, options);
}

/// Points in space have a report of their own: no pose is known.
int run_points(const TrackArguments& arguments, const CommonOptions& common) {
  TrackPointsOptions options;
  static_cast<TrackTask&>(options) = arguments.task;
  const TrackPointsReport report = track_points(arguments.capture, options);
  if (common.json)
    fmt::print("{}\n", to_json(report).dump(2));
  else
    print_points(report);
  log::info("points in {}", options.out.string());
  return 0;
}

/// @throws UsageError for options that cannot be combined with --method points
void check_points(const TrackArguments& arguments) {
  const TrackTask& task = arguments.task;
  if (arguments.surface || task.vertices || arguments.looks_at_all_frames_first() || arguments.live() ||
      !arguments.preview.empty() || !arguments.texture.empty() || !arguments.camera.empty() ||
      !arguments.deepcap.run.empty() || !arguments.config.empty() || !arguments.set.empty() ||
      !arguments.prior_motion.empty())
    fail<UsageError>(
        "--method points knows no body and uses all cameras; of the options only --out, --sequences and "
        "--limit-frames belong to it");
}

/// @throws UsageError for options that cannot be combined
void check(const TrackArguments& arguments) {
  const bool livecap = arguments.method == "livecap", deepcap = arguments.method == "deepcap";
  if ((livecap || deepcap) && arguments.surface)
    fail<UsageError>(
        "--surface belongs to --method multiview; livecap always tracks the surface, unless the configuration has "
        "`surface: {{enabled: false}}`, and deepcap tracks it if DefNet was trained");
  if (!livecap && !deepcap && !arguments.camera.empty())
    fail<UsageError>("--camera belongs to livecap and deepcap; the multi-view fit uses all cameras of the capture");
  if (!livecap && !deepcap && (arguments.live() || !arguments.preview.empty() || !arguments.texture.empty()))
    fail<UsageError>("--source, --preview and --texture belong to livecap and deepcap, which use one camera");
  if ((livecap || deepcap) && arguments.looks_at_all_frames_first())
    fail<UsageError>(
        "--scale and --place-landmarks belong to --method multiview, which sees the body with all cameras");
  if (!arguments.scale.empty() && arguments.place_landmarks)
    fail<UsageError>(
        "--scale and --place-landmarks explain the same distances; give one of them: --scale for another person's "
        "body, --place-landmarks for this person's body and a detector with other joints");
  if (deepcap && arguments.deepcap.run.empty())
    fail<UsageError>("--method deepcap needs --run RUN, a run of `doppel train` or `doppel adapt`");
  if (deepcap && (!arguments.config.empty() || !arguments.set.empty()))
    fail<UsageError>("--config and --set belong to multiview and livecap; deepcap has the configuration of its run");
  if (!deepcap && !arguments.deepcap.run.empty() && !(livecap && arguments.live()))
    fail<UsageError>(
        "--run belongs to --method deepcap, or to livecap with --source, where its PoseNet predicts 3D joints");
  if (!arguments.live() && (arguments.empty_frames > 0 || arguments.playing.live || arguments.playing.repeat > 1 ||
                            !arguments.detect.empty() || !arguments.send.empty()))
    fail<UsageError>("--empty-frames, --live, --repeat, --detect and --send belong to --source");
  if (!livecap && !arguments.prior_motion.empty())
    fail<UsageError>("--prior-motion belongs to --method livecap, which one camera leaves uncertain about the pose");
  if (deepcap && !arguments.live() && !arguments.preview.empty())
    fail<UsageError>("deepcap writes SEQUENCE.mp4 instead of a preview; --preview belongs to livecap, or to --source");
  if (!arguments.texture.empty() && arguments.preview.empty() && (livecap || arguments.live()))
    fail<UsageError>("--texture is drawn in the preview; give --preview too");
}

/// @throws UsageError for work that is not cut into sequences
void check_in_shards(const TrackArguments& arguments) {
  if (arguments.live()) fail<UsageError>("--shard: live images come to one machine; leave --shard or --source out");
  if (arguments.looks_at_all_frames_first())
    fail<UsageError>(
        "--shard: --scale and --place-landmarks look at all sequences together; use them in a run without --shard, "
        "and track with the character or the landmarks that it writes");
  if (!arguments.preview.empty()) fail<UsageError>("--shard: --preview shows one run; leave one of them out");
  if (lacks_keypoints(arguments.capture))
    fail<UsageError>(
        "--shard: {} names no keypoints, and each shard would detect those of all sequences; run "
        "`doppel detect` first, which knows --shard too, and track its result",
        arguments.capture);
}

int merge(const TrackArguments& arguments, const std::vector<fs::path>& shards) {
  if (arguments.method == "points") {
    TrackPointsOptions options;
    static_cast<TrackTask&>(options) = arguments.task;
    merge_points(arguments.capture, options, shards);
  } else {
    const auto footage = Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera);
    merge_tracks(*footage, arguments.task, shards);
  }
  return 0;
}

int run(TrackArguments arguments, const CommonOptions& common) {
  const bool points = arguments.method == "points";
  points ? check_points(arguments) : check(arguments);
  TrackTask& task = arguments.task;
  if (common.shard || !common.merged.empty()) check_in_shards(arguments);
  if (task.out.empty() && !common.shard) task.out = default_track_out(arguments.capture);
  task.shard = common.shard;
  begin_work(common, task.out, [&] { return capture_inputs(find_capture(arguments.capture)); });
  const FolderLock lock(task.out);
  if (!common.merged.empty()) return merge(arguments, common.merged.folders);
  if (!arguments.live())
    arguments.capture =
        with_keypoints(arguments.capture, task.out / "detected", {arguments.needs_masks(), !points}, common).string();
  if (points) {
    const int code = run_points(arguments, common);
    finish_work(common, task.out, nullptr);
    return code;
  }
  const TrackReport report = arguments.live()                ? track_source(arguments)
                             : arguments.method == "livecap" ? track_with_one_camera(arguments)
                             : arguments.method == "deepcap" ? track_with_networks(arguments)
                                                             : track_with_all_cameras(arguments);
  if (!is_stopped(report)) finish_work(common, task.out, nullptr);
  if (common.json)
    fmt::print("{}\n", to_json(report).dump(2));
  else
    print_table(report);
  if (arguments.live())
    log::info("results in {}", task.out.string());
  else
    log::info("motions in {}; next: doppel prepare {}", task.out.string(), task.out.string());
  if (!is_stopped(report)) return 0;
  log::warn("the last sequence was not tracked to its end; the same command tracks all again");
  return 1;
}

}  // namespace

Command add_track(CLI::App& program) {
  CLI::App* app = program.add_subcommand("track", "Find pose and surface in every frame from keypoints and masks");
  app->footer(kTrackExample);
  auto arguments = std::make_shared<TrackArguments>();
  TrackTask& task = arguments->task;
  app->add_option("capture", arguments->capture, "Capture folder, its capture.yaml, or a prepared capture")->required();
  app->add_option(
         "--method", arguments->method,
         "multiview: a fit to all cameras; livecap: a fit to one camera; deepcap: trained networks, one camera; "
         "points: the keypoints in space, without a character")
      ->check(CLI::IsMember({"multiview", "livecap", "deepcap", "points"}))
      ->capture_default_str();
  app->add_option("--out", task.out, "Folder to write into (default: CAPTURE/tracked)");
  app->add_option("--sequences", task.sequences, "Names of the sequences to track (default: all)")->delimiter(',');
  app->add_option("--limit-frames", task.limit_frames, "Largest number of frames of each sequence (0: all)")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app->add_option("--config", arguments->config, "Configuration of weights and thresholds (keys: docs/tracking.md)");
  app->add_option("--camera", arguments->camera,
                  "Name of the camera for livecap and deepcap, if the capture has several");
  app->add_option("--prior-motion", arguments->prior_motion,
                  "livecap: a motion of the same character, for example the studio's; the poses usual in it are more "
                  "probable");
  app->add_option("--set", arguments->set, "Override a key of the configuration: --set silhouette.weight=0");
  app->add_flag("--surface", arguments->surface,
                "Deform the surface to the masks after the pose; writes SEQUENCE_graph.npy");
  app->add_option("--scale", arguments->scale,
                  "bones: first find the lengths of the bones over all frames together, for a body that is not quite "
                  "this person's; the scaled character is written to OUT/character")
      ->check(CLI::IsMember({"bones"}));
  app->add_flag("--place-landmarks", arguments->place_landmarks,
                "First find where on the body the detector sees its points, over many frames together; the places are "
                "written to OUT/landmarks.csv");
  app->add_flag("--vertices", task.vertices, "Write SEQUENCE_vertices.npy too: the surface, skinned or deformed");
  app->add_option("--sheet-frames", arguments->sheet_frames, "Frames on the contact sheet SEQUENCE.jpg (0: none)")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  DeepcapOptions& deepcap = arguments->deepcap;
  app->add_option(
      "--run", deepcap.run,
      "deepcap: a run of PoseNet, or of PoseNet and DefNet; livecap with --source: PoseNet predicts joints");
  app->add_option("--smoothing", deepcap.smoothing,
                  "deepcap: sigma of the Gaussian over five frames, in frames (0: none)")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  app->add_flag("!--no-film", deepcap.film,
                "deepcap: do not write SEQUENCE.mp4, a film of the surface over the images");
  app->add_option("--source", arguments->source,
                  "livecap, deepcap: live images instead of those of the capture: a camera (0, 1, ...), a video or a "
                  "folder of images; character, calibration and landmarks are those of the capture");
  app->add_option("--empty-frames", arguments->empty_frames,
                  "Number of images at the start of the source that show the empty scene")
      ->check(CLI::Range(0, 1000));
  app->add_flag("--live", arguments->playing.live,
                "Play a file as the source at its own rate; images that come too fast are dropped");
  app->add_option(
      "--send", arguments->send,
      "With --source: send each pose to an avatar program by the VMC protocol, e.g. vmc://127.0.0.1:39539, or to "
      "a page of `doppel view`, by the address that it prints");
  app->add_option("--repeat", arguments->playing.repeat, "How often to play a file as the source")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  const CLI::Option* detect =
      app->add_option(
             "--detect", arguments->detect,
             "With --source: keypoints, 3D joints and masks of its images by MediaPipe's BlazePose, instead of "
             "the capture's files and detector (default: full)")
          ->check(CLI::IsMember({"lite", "full", "heavy"}))
          ->expected(0, 1)
          ->type_name("[MODEL]");
  const CLI::Option* preview =
      app->add_option(
             "--preview", arguments->preview,
             "Show the surface over the image and from the side: in a window (keys a and d rotate, q ends), or in "
             "an .mp4 file if there is no screen")
          ->expected(0, 1)
          ->type_name("[FILE.mp4]");
  app->add_option("--texture", arguments->texture,
                  "Texture image for the surface in the preview, or in the film of deepcap");
  return {app,
          [arguments, preview, detect](const CommonOptions& common) {
            if (detect->count() > 0 && arguments->detect.empty()) arguments->detect = "full";
            if (preview->count() > 0 && arguments->preview.empty()) arguments->preview = "window";
            return run(*arguments, common);
          },
          true};
}

}  // namespace doppel::tools
