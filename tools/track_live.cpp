#include <memory>
#include <optional>

#include "doppel/core/log.h"
#include "doppel/io/vmc/vmc_sender.h"
#include "doppel/track/live/live_run.h"
#include "doppel/track/live/posenet_joints.h"
#include "doppel/track/method_trackers.h"
#include "doppel/view/view_sender.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

constexpr char kLiveExample[] =
    "Examples:\n"
    "  doppel track live recordings/desk --source 0 --empty-frames 25 --preview\n"
    "  doppel track live recordings/street --source street.mp4 --detect\n"
    "  doppel track live recordings/desk --source 0 --detect --send vmc://127.0.0.1:39539\n"
    "  doppel track live recordings/street --source street.mp4 --deepcap runs/anna-street\n"
    "Character, calibration and landmarks are those of CAPTURE.";

struct LiveArguments : TrackArguments {
  std::string sequence, source, send;
  std::string posenet, deepcap;  ///< runs
  std::string detect;            ///< a model of BlazePose; empty: evidence as the capture says
  SourceOptions playing;
  int empty_frames = 0;
};

void learn_empty_scene(const LiveArguments& arguments, FrameSource& source, LiveView& view) {
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

LiveViewOptions live_view_options(const LiveArguments& arguments, const LivecapConfig& config) {
  LiveViewOptions options;
  options.camera = arguments.camera;
  options.sequence = arguments.sequence;
  options.outline_pixels = config.fit.outline_pixels;
  options.from_camera = is_camera(arguments.source);
  if (!arguments.detect.empty()) options.blazepose = parse_blazepose_model(arguments.detect);
  return options;
}

LiveRunOptions run_options(const LiveArguments& arguments, const LivecapConfig& config, const Character& character) {
  const bool deepcap = !arguments.deepcap.empty();
  LiveRunOptions options;
  static_cast<TrackTask&>(options) = arguments.task;
  options.method = deepcap ? "deepcap" : "livecap";
  options.filter = !deepcap && config.filter;
  options.smoothing = deepcap ? 0.0 : config.smoothing;
  if (!arguments.send.empty()) options.on_pose = sending_to(arguments.send, character);
  return options;
}

TrackReport track_source(const LiveArguments& arguments) {
  const auto source = open_source(arguments.source, arguments.playing);
  LivecapConfig config = read_livecap_config(config_document(arguments));
  LiveView view(arguments.capture, source->size(), live_view_options(arguments, config));
  const Character& character = view.character();
  const bool deepcap = !arguments.deepcap.empty();
  std::optional<TrainedPose> trained;
  if (deepcap) trained.emplace(TrainedPose::load(arguments.deepcap));
  if (!arguments.posenet.empty()) {
    trained.emplace(TrainedPose::load(arguments.posenet));
    view.find_joints_by(joints_of_posenet(view, *trained));
  }
  add_prior_motion(config, arguments, character);
  const auto tracker =
      deepcap ? make_deepcap_tracker(*trained, character, view.landmarks(), view.camera(), LostFrames::hold)
              : make_livecap_tracker(character, view.landmarks(), view.camera(), config);
  const auto preview = preview_of(arguments, view.camera(), character, source->frames_per_second());
  learn_empty_scene(arguments, *source, view);
  return track_live(*source, view, *tracker, run_options(arguments, config, character), preview.get());
}

int run_live(LiveArguments arguments, const CommonOptions& common) {
  const FolderLock lock = begin_track(arguments, common);
  return finish_track(track_source(arguments), arguments, common,
                      fmt::format("results in {}", arguments.task.out.string()));
}

void add_source_options(CLI::App& app, LiveArguments& arguments) {
  app.add_option("--source", arguments.source, "A camera (0, 1, ...), a video or a folder of images")->required();
  add_camera_option(app, arguments);
  app.add_option("--sequence", arguments.sequence, "Name of the sequence that the source shows, if there are several");
  app.add_option("--empty-frames", arguments.empty_frames,
                 "Number of images at the start of the source that show the empty scene")
      ->check(CLI::Range(0, 1000));
  app.add_flag("--real-time", arguments.playing.live,
               "Play a file at its own rate; images that come too fast are dropped");
  app.add_option("--repeat", arguments.playing.repeat, "How often to play a file")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option_function<std::string>(
         "--detect", [&arguments](const std::string& model) { arguments.detect = model.empty() ? "full" : model; },
         "Keypoints, 3D joints and masks by MediaPipe's BlazePose, instead of the capture's files and detector: lite, "
         "full or heavy (default: full)")
      ->check(CLI::IsMember({"lite", "full", "heavy"}))
      ->expected(0, 1)
      ->type_name("[MODEL]");
}

/// The fit of livecap, or the networks of a run, which leave nothing to configure.
void add_tracker_options(CLI::App& app, LiveArguments& arguments) {
  CLI::Option* deepcap = app.add_option(
      "--deepcap", arguments.deepcap,
      "Predict pose and surface by the networks of this run, as `doppel track deepcap`, instead of the fit of "
      "`doppel track livecap`");
  deepcap->excludes(
      app.add_option("--posenet", arguments.posenet, "The PoseNet of this run predicts the 3D joints for the fit"));
  for (CLI::Option* option : add_config_options(app, arguments)) deepcap->excludes(option);
  deepcap->excludes(add_prior_motion_option(app, arguments));
}

}  // namespace

Command add_track_live(CLI::App& track) {
  auto arguments = std::make_shared<LiveArguments>();
  CLI::App* app =
      add_track_method(track, "live", "Track the images of a camera, or of a video, as they arrive", *arguments);
  app->footer(kLiveExample);
  add_source_options(*app, *arguments);
  add_tracker_options(*app, *arguments);
  add_vertices_option(*app, *arguments);
  add_preview_options(*app, *arguments);
  app->add_option("--send", arguments->send,
                  "Send each pose to an avatar program by the VMC protocol, e.g. vmc://127.0.0.1:39539, or to a page "
                  "of `doppel view`, by the address that it prints");
  return {app, [arguments](const CommonOptions& common) { return run_live(*arguments, common); }};
}

}  // namespace doppel::tools
