#include <memory>

#include "doppel/core/error.h"
#include "doppel/track/livecap/livecap_capture.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

constexpr char kLivecapExample[] =
    "Examples:\n"
    "  doppel track livecap recordings/street --vertices\n"
    "  doppel track livecap recordings/anna --camera 3 --preview anna.mp4\n"
    "`doppel track live` fits to a camera or a video as its images arrive. Keys: docs/tracking.md.";

TrackReport track_with_one_camera(const TrackArguments& arguments) {
  LivecapCaptureOptions options{arguments.task, read_livecap_config(config_document(arguments)),
                                arguments.sheet_frames};
  const auto footage = Footage::open(arguments.capture, options.config.fit.outline_pixels, arguments.camera);
  check_one_camera(*footage);
  add_prior_motion(options.config, arguments, footage->character());
  const auto preview = preview_of(arguments, footage->cameras().front(), footage->character(), footage->capture().fps);
  return track_livecap(*footage, options, preview.get());
}

int run_livecap(const TrackArguments& arguments, const CommonOptions& common) {
  if ((common.shard || !common.merged.empty()) && !arguments.preview.empty())
    fail<UsageError>("--shard: --preview shows one run; leave one of them out");
  return track_sequences(arguments, common, true, track_with_one_camera);
}

}  // namespace

Command add_track_livecap(CLI::App& track) {
  auto arguments = std::make_shared<TrackArguments>();
  CLI::App* app = add_track_method(track, "livecap", "Fit pose and surface to one camera", *arguments);
  app->footer(kLivecapExample);
  add_sequences_option(*app, *arguments);
  add_camera_option(*app, *arguments);
  add_config_options(*app, *arguments);
  add_prior_motion_option(*app, *arguments);
  add_vertices_option(*app, *arguments);
  add_sheet_option(*app, *arguments);
  add_preview_options(*app, *arguments);
  return {app, [arguments](const CommonOptions& common) { return run_livecap(*arguments, common); }, true};
}

}  // namespace doppel::tools
