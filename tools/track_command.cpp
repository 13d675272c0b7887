#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/track/deepcap.h"
#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/track_capture.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kExample[] =
    "Example:\n"
    "  doppel track recordings/anna --method multiview --out recordings/anna/tracked\n"
    "  doppel prepare recordings/anna/tracked --out prepared/anna\n"
    "  doppel track recordings/street --method livecap --vertices\n"
    "  doppel track recordings/street --method deepcap --run runs/anna-street\n"
    "CAPTURE needs a calibration, a character, and keypoints and masks (docs/tracking.md); multiview needs at least "
    "two\n"
    "cameras. Its sequences need no motion: the capture.yaml that is written names the tracked ones.";

struct Arguments {
  std::string capture, method = "multiview", config, camera;
  std::vector<std::string> set;
  TrackTask task;
  bool surface = false;
  int sheet_frames = TrackOptions().sheet_frames;
  DeepcapOptions deepcap;  ///< what deepcap alone has
};

ConfigDocument config_document(const Arguments& arguments) {
  if (arguments.config.empty()) return ConfigDocument::parse("{}", "the defaults", arguments.set);
  return ConfigDocument::load(arguments.config, arguments.set);
}

void print_table(const nlohmann::ordered_json& report) {
  fmt::print("{:<16} {:>7} {:>6} {:>10} {:>14} {:>9}\n", "sequence", "frames", "lost", "recovered", "keypoints (px)",
             "frames/s");
  for (const auto& [name, sequence] : report["sequences"].items()) {
    fmt::print("{:<16} {:>7} {:>6} {:>10} {:>14.2f} {:>9.1f}\n", name, sequence["frames"].get<long>(),
               sequence["lost_frames"].size(), sequence["recovered"].get<int>(),
               sequence["keypoint_error_px"].get<double>(), sequence["frames_per_second"].get<double>());
    if (sequence.contains("against_given_motion"))
      fmt::print("  against the motion that was given: landmarks {:.1f} mm apart on average\n",
                 sequence["against_given_motion"]["MPJPE_mm"].get<double>());
    if (sequence.contains("surface"))
      fmt::print("  IoU with the masks: {:.4f} of the pose alone, {:.4f} of the bent surface, {:.1f} frames/s\n",
                 sequence["surface"]["IoU_pose"].get<double>(), sequence["surface"]["IoU"].get<double>(),
                 sequence["surface"]["frames_per_second"].get<double>());
    if (sequence.contains("livecap")) {
      const auto& figures = sequence["livecap"];
      const auto& times = figures["milliseconds"];
      fmt::print("  IoU with the masks: {:.4f} of the pose alone, {:.4f} of the surface\n",
                 figures["IoU_pose"].get<double>(), figures["IoU"].get<double>());
      fmt::print("  {:.1f} frames/s with reading; milliseconds a frame: read {:.1f}, pose {:.1f}, surface {:.1f}\n",
                 figures["frames_per_second"].get<double>(), times["read"].get<double>(), times["pose"].get<double>(),
                 times["surface"].get<double>());
    }
    if (!sequence["lost_frames"].empty())
      fmt::print("  not to be trusted, and interpolated: frames {}\n", sequence["lost_frames"].dump());
  }
}

fs::path default_out(const fs::path& capture) {
  return (fs::is_directory(capture) ? capture : capture.parent_path()) / "tracked";
}

nlohmann::ordered_json track_with_one_camera(const Arguments& arguments) {
  const LivecapCaptureOptions options{arguments.task, read_livecap_config(config_document(arguments)),
                                      arguments.sheet_frames};
  return track_livecap(*Footage::open(arguments.capture, options.config.fit.outline_pixels, arguments.camera), options);
}

nlohmann::ordered_json track_with_networks(const Arguments& arguments) {
  DeepcapOptions options = arguments.deepcap;
  if (options.run.empty())
    fail<UsageError>("--method deepcap needs --run RUN: what `doppel train` or `doppel adapt` wrote");
  if (!arguments.config.empty() || !arguments.set.empty())
    fail<UsageError>("--config and --set belong to the methods that fit; deepcap has the configuration of its run");
  static_cast<TrackTask&>(options) = arguments.task;
  return track_deepcap(*Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera), options);
}

nlohmann::ordered_json track_with_all_cameras(const Arguments& arguments) {
  const TrackOptions options{arguments.task, read_track_config(config_document(arguments)), arguments.surface,
                             arguments.sheet_frames};
  return track_capture(*Footage::open(arguments.capture, options.config.fit.outline_pixels), options);
}

int run(Arguments arguments, const CommonOptions& common) {
  TrackTask& task = arguments.task;
  if (task.out.empty()) task.out = default_out(arguments.capture);
  const bool livecap = arguments.method == "livecap", deepcap = arguments.method == "deepcap";
  if ((livecap || deepcap) && arguments.surface)
    fail<UsageError>(
        "--surface belongs to --method multiview; livecap tracks the surface always, unless the "
        "configuration says `surface: {{enabled: false}}`, and deepcap where DefNet was trained");
  if (!livecap && !deepcap && !arguments.camera.empty())
    fail<UsageError>("--camera belongs to livecap and deepcap; the multi-view fit takes all cameras of the capture");
  if (!deepcap && !arguments.deepcap.run.empty())
    fail<UsageError>("--run belongs to --method deepcap; this method needs no networks");
  const nlohmann::ordered_json report = livecap   ? track_with_one_camera(arguments)
                                        : deepcap ? track_with_networks(arguments)
                                                  : track_with_all_cameras(arguments);
  if (common.json)
    fmt::print("{}\n", report.dump(2));
  else
    print_table(report);
  log::info("motions in {}; next: doppel prepare {}", task.out.string(), task.out.string());
  return 0;
}

}  // namespace

Command add_track(CLI::App& program) {
  CLI::App* app = program.add_subcommand("track", "Find the person's pose in every frame from keypoints and masks");
  app->footer(kExample);
  auto arguments = std::make_shared<Arguments>();
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
  app->add_option("--run", deepcap.run, "deepcap: a run of PoseNet, or of PoseNet and DefNet");
  app->add_option("--smoothing", deepcap.smoothing, "deepcap: sigma over five frames, in frames (0: none)")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  app->add_flag("!--no-film", deepcap.film, "deepcap: without SEQUENCE.mp4, the surface over the pictures");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
