#include <memory>

#include "doppel/track/refine/refine_capture.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

constexpr char kRefineExample[] =
    "Examples:\n"
    "  doppel track recordings/anna --out tracked\n"
    "  doppel track refine tracked --out refined\n"
    "  doppel prepare refined --out prepared\n"
    "CAPTURE needs motions, for example of `doppel track`, and images. Keys: docs/tracking.md.";

struct RefineArguments : TrackArguments {
  RefineOptions options;
};

TrackReport refine_found(const TrackArguments& found, RefineOptions options) {
  static_cast<TrackTask&>(options) = found.task;
  options.sheet_frames = found.sheet_frames;
  options.config = read_track_config(config_document(found));
  const auto footage = Footage::open_unprepared(found.capture, options.config.fit.outline_pixels,
                                                "whose images are cut out and reduced");
  return refine_capture(*footage, options);
}

}  // namespace

Command add_track_refine(CLI::App& track) {
  auto arguments = std::make_shared<RefineArguments>();
  CLI::App* app = add_track_method(track, "refine",
                                   "Register pose, surface and texture of a tracked capture by its images", *arguments);
  app->footer(kRefineExample);
  add_sequences_option(*app, *arguments);
  add_config_options(*app, *arguments);
  RefineOptions& options = arguments->options;
  app->add_option("--frames", options.frames,
                  "Frames of the training sequences from which texture and template are learnt")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app->add_option("--rounds", options.rounds, "Rounds of poses, surface and texture in these frames (0: none)")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  app->add_option("--texture-size", options.texture_size, "Texels along each side of the texture")
      ->check(CLI::Range(64, 8192))
      ->capture_default_str();
  app->add_option("--smoothing", options.smoothing, "Sigma of the smoothing of poses, frames; 0: none")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  add_sheet_option(*app, *arguments);
  return {app, [arguments](const CommonOptions& common) {
            return track_sequences(*arguments, common, false, [&](const TrackArguments& found) {
              return refine_found(found, arguments->options);
            });
          }};
}

}  // namespace doppel::tools
