#include "doppel/track/points/track_points.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>

#include "doppel/core/log.h"
#include "doppel/track/track_results.h"
#include "shared_work.h"
#include "track_methods.h"

namespace doppel::tools {

namespace {

constexpr char kPointsExample[] =
    "Example:\n"
    "  doppel track points recordings/anna\n"
    "CAPTURE needs a calibration and keypoints, and no character.";

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

/// Points in space have a report of their own: no pose is known.
int run_points(TrackArguments arguments, const CommonOptions& common) {
  const FolderLock lock = begin_track(arguments, common);
  TrackPointsOptions options;
  static_cast<TrackTask&>(options) = arguments.task;
  if (!common.merged.empty()) {
    merge_points(arguments.capture, options, common.merged.folders);
    return 0;
  }
  check_tracked_method(options.out, "points");
  find_keypoints(arguments, {}, common);
  const TrackPointsReport report = track_points(arguments.capture, options);
  finish_work(common, options.out, nullptr);
  if (common.json)
    fmt::print("{}\n", to_json(report).dump(2));
  else
    print_points(report);
  log::info("points in {}", options.out.string());
  return 0;
}

}  // namespace

Command add_track_points(CLI::App& track) {
  auto arguments = std::make_shared<TrackArguments>();
  CLI::App* app = add_track_method(track, "points",
                                   "Find the keypoints in space with several cameras, without a character", *arguments);
  app->footer(kPointsExample);
  add_sequences_option(*app, *arguments);
  return {app, [arguments](const CommonOptions& common) { return run_points(*arguments, common); }, true};
}

}  // namespace doppel::tools
