#include <memory>

#include "doppel/core/error.h"
#include "doppel/track/deepcap/deepcap.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

constexpr char kDeepcapExample[] =
    "Example:\n"
    "  doppel track deepcap recordings/street --run runs/anna-street\n"
    "RUN is a run of `doppel train configs/small/deepcap.yaml`, or of `doppel adapt`.\n"
    "`doppel track live --deepcap RUN` predicts from a camera or a video as its images arrive.";

TrackReport track_with_networks(const TrackArguments& arguments, DeepcapOptions options) {
  static_cast<TrackTask&>(options) = arguments.task;
  options.view = view_options(arguments);
  return track_deepcap(*Footage::open(arguments.capture, PoseFitOptions().outline_pixels, arguments.camera), options);
}

}  // namespace

Command add_track_deepcap(CLI::App& track) {
  struct Arguments : TrackArguments {
    DeepcapOptions deepcap;
    std::string smooth = "poses";
  };
  auto arguments = std::make_shared<Arguments>();
  DeepcapOptions& deepcap = arguments->deepcap;
  CLI::App* app =
      add_track_method(track, "deepcap", "Predict pose and surface from one camera by trained networks", *arguments);
  app->footer(kDeepcapExample);
  add_sequences_option(*app, *arguments);
  add_camera_option(*app, *arguments);
  app->add_option("--run", deepcap.run, "A run of PoseNet, or of PoseNet and DefNet")->required();
  app->add_option("--smoothing", deepcap.smoothing, "Sigma of the Gaussian over five frames, in frames (0: none)")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  app->add_option("--smooth", arguments->smooth,
                  "What is smoothed: poses and deformations, or the vertices of the surface (5.8)")
      ->check(CLI::IsMember({"poses", "vertices"}))
      ->capture_default_str();
  add_vertices_option(*app, *arguments);
  app->add_flag("!--no-film", deepcap.film, "Do not write SEQUENCE.mp4, a film of the surface over the images");
  app->add_option("--texture", arguments->texture, "Texture image for the surface in the film");
  const auto run = [arguments](const CommonOptions& common) {
    if (arguments->smooth == "vertices" && !arguments->deepcap.film && !arguments->task.vertices)
      fail<UsageError>(
          "--smooth vertices changes the film and the vertices alone, and neither is written; add --vertices, or leave "
          "--no-film out");
    arguments->deepcap.smoothed =
        arguments->smooth == "vertices" ? DeepcapSmoothing::vertices : DeepcapSmoothing::poses;
    return track_sequences(*arguments, common, true, [arguments](const TrackArguments& found) {
      return track_with_networks(found, arguments->deepcap);
    });
  };
  return {app, run, true};
}

}  // namespace doppel::tools
