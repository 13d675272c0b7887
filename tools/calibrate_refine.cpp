#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "calibrate_rig.h"
#include "calibrate_subcommands.h"
#include "doppel/calibration/estimation/find_moved_cameras.h"
#include "doppel/calibration/estimation/refine_rig.h"
#include "doppel/core/angles.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel::tools {

namespace {

using Json = nlohmann::ordered_json;

struct RefineArguments {
  std::string capture, sequence, out;
  std::vector<std::string> fixed;
  bool focal = false, principal_point = false, points_only = false;
};

/// What the cameras saw in the sequence that was named, otherwise in all that have keypoints.
std::vector<RigTake> read_takes(RigFootage& footage, const RefineArguments& arguments, std::size_t most_times) {
  std::vector<std::size_t> sequences{footage.sequence};
  if (arguments.sequence.empty())
    for (std::size_t s = footage.sequence + 1; s < footage.capture.sequences.size(); ++s)
      if (!footage.capture.sequences[s].keypoints.empty()) sequences.push_back(s);
  std::vector<RigTake> takes;
  for (const std::size_t sequence : sequences) {
    footage.sequence = sequence;
    read_tracks(footage);
    takes.push_back({footage.tracks, {}});
  }
  if (arguments.points_only) return takes;
  const std::vector<std::vector<double>> times = times_of_takes(takes, most_times);
  for (std::size_t i = 0; i < takes.size(); ++i) {
    footage.sequence = sequences[i];
    footage.tracks = takes[i].tracks;
    takes[i].outlines = read_outlines(footage, times[i]);
  }
  return takes;
}

std::vector<int> indices_of(const std::vector<std::string>& names, const RigFootage& footage) {
  std::vector<int> indices;
  for (const std::string& name : names) {
    const std::size_t before = indices.size();
    for (std::size_t c = 0; c < footage.filmed.cameras.size(); ++c)
      if (footage.filmed.cameras[c].name == name) indices.push_back(static_cast<int>(c));
    if (indices.size() == before) fail<UsageError>("{} has no camera {} to keep as it is", footage.capture.name, name);
  }
  return indices;
}

/// All cameras of the calibration file, with those that were refined in their positions.
std::vector<Camera> all_cameras(const RigFootage& footage, const std::vector<Camera>& refined) {
  std::vector<Camera> all = calibrated_cameras(footage.capture);
  for (std::size_t c = 0; c < refined.size(); ++c) all[footage.filmed.file_index[c]] = refined[c];
  return all;
}

Json json_of(const RigRefinement& found, const std::vector<MovedCamera>& moved, const std::string& out) {
  Json report{{"out", out},
              {"points", found.points},
              {"median_before_px", found.median_before},
              {"median_after_px", found.median_after},
              {"cameras", Json::array()},
              {"moved", Json::array()}};
  for (const CameraRefinement& camera : found.reports)
    report["cameras"].push_back({{"name", camera.name},
                                 {"refined", camera.refined},
                                 {"observations", camera.observations},
                                 {"tangents", camera.tangents},
                                 {"inliers", camera.inliers},
                                 {"median_before_px", camera.median_before},
                                 {"mean_before_px", camera.mean_before},
                                 {"median_after_px", camera.median_after},
                                 {"mean_after_px", camera.mean_after},
                                 {"rotation_change_deg", camera.rotation_change / kRadiansPerDegree},
                                 {"rotation_sigma_deg", camera.rotation_sigma / kRadiansPerDegree},
                                 {"centre_change_mm", 1000.0 * camera.centre_change},
                                 {"centre_sigma_mm", 1000.0 * camera.centre_sigma},
                                 {"focal_change", camera.focal_change},
                                 {"focal_sigma", camera.focal_sigma},
                                 {"reason", camera.reason}});
  for (const MovedCamera& camera : moved)
    report["moved"].push_back({{"name", camera.name},
                               {"frame", camera.frame},
                               {"frame_sigma", camera.frame_sigma},
                               {"jump_px", camera.jump},
                               {"rotation_deg", camera.rotation / kRadiansPerDegree},
                               {"shift_mm", 1000.0 * camera.shift}});
  return report;
}

void print_table(const RigRefinement& found, const std::vector<MovedCamera>& moved, bool focal) {
  std::printf("%-16s %8s %8s %8s %18s %18s %20s%s\n", "camera", "points", "inliers", "tangents", "median/mean before",
              "median/mean after", "turned (deg)/moved (mm)", focal ? "   focal" : "");
  for (const CameraRefinement& camera : found.reports) {
    if (!camera.refined) {
      std::printf("%-16s kept: %s\n", camera.name.c_str(), camera.reason.c_str());
      continue;
    }
    std::printf("%-16s %8ld %7.1f%% %8ld %9.2f/%5.2f px %9.2f/%5.2f px %10.3f +- %.3f / %.1f +- %.1f",
                camera.name.c_str(), camera.observations, 100.0 * camera.inliers, camera.tangents, camera.median_before,
                camera.mean_before, camera.median_after, camera.mean_after, camera.rotation_change / kRadiansPerDegree,
                camera.rotation_sigma / kRadiansPerDegree, 1000.0 * camera.centre_change, 1000.0 * camera.centre_sigma);
    if (focal) std::printf("   %+.2f%% +- %.2f%%", 100.0 * camera.focal_change, 100.0 * camera.focal_sigma);
    std::printf("\n");
  }
  std::printf("median distance of points from their projections: %.2f px before, %.2f px after\n", found.median_before,
              found.median_after);
  for (const MovedCamera& camera : moved)
    std::printf(
        "camera %s moved at frame %.0f: turned by %.2f degrees, shifted by %.0f mm; calibrate the parts before and "
        "after apart from each other\n",
        camera.name.c_str(), camera.frame, camera.rotation / kRadiansPerDegree, 1000.0 * camera.shift);
}

/// With few poses, or with keypoints of another person, cameras that turn far can be wrong.
void warn_of_large_changes(const RigRefinement& found) {
  constexpr double kLargeTurn = 10.0;  // degrees
  for (const CameraRefinement& camera : found.reports)
    if (camera.rotation_change > kLargeTurn * kRadiansPerDegree)
      log::warn(
          "camera {} is turned by {:.0f} degrees and moved by {:.0f} mm; unless somebody moved it, the keypoints do "
          "not determine the cameras: use frames with more different poses, or `--fix` for cameras that are right",
          camera.name, camera.rotation_change / kRadiansPerDegree, 1000.0 * camera.centre_change);
}

int run_refine(const RefineArguments& arguments, const CommonOptions& common) {
  RigFootage footage = open_rig_footage(arguments.capture, arguments.sequence);
  RefineOptions options;
  options.focal = arguments.focal;
  options.principal_point = arguments.principal_point;
  options.fixed = indices_of(arguments.fixed, footage);
  const std::filesystem::path out = calibration_to_write(footage.capture, arguments.out, "_refined");
  check_refined_target(out, footage.capture);
  const std::vector<RigTake> takes = read_takes(footage, arguments, options.most_times);
  const RigRefinement found = refine_rig(footage.filmed.cameras, takes, options);
  warn_of_large_changes(found);
  std::vector<MovedCamera> moved;
  if (found.cameras.size() >= 3)
    for (const RigTake& take : takes)
      for (const MovedCamera& camera : find_moved_cameras(found.cameras, take.tracks)) moved.push_back(camera);
  write_result(out, all_cameras(footage, found.cameras));
  if (common.json) {
    std::printf("%s\n", json_of(found, moved, out.string()).dump(2).c_str());
    return 0;
  }
  print_table(found, moved, arguments.focal);
  std::printf("written: %s\n", out.string().c_str());
  print_keys_to_remove(footage.capture);
  return 0;
}

}  // namespace

Command add_calibrate_refine(CLI::App& calibrate) {
  CLI::App* app =
      calibrate.add_subcommand("refine", "Mend a capture's calibration by the person's keypoints and outlines");
  app->fallthrough();
  auto arguments = std::make_shared<RefineArguments>();
  app->add_option("capture", arguments->capture, "capture.yaml, or a folder that is recognised as a capture")
      ->required();
  app->add_option("--sequence", arguments->sequence,
                  "Sequence whose keypoints and masks are used (default: all that have keypoints)");
  app->add_flag("--points-only", arguments->points_only, "Use the keypoints alone, not the outlines of the masks");
  app->add_flag("--focal", arguments->focal, "Also refine the focal lengths");
  app->add_flag("--principal-point", arguments->principal_point, "Also refine the principal points");
  app->add_option("--fix", arguments->fixed, "Cameras that are kept as they are (repeatable)");
  app->add_option(
      "--out", arguments->out,
      "Calibration to write: .yml, .toml or .calibration (default: NAME_refined.yml beside the capture.yaml)");
  app->footer("Example: doppel calibrate refine recordings/anna --focal");
  return {app, [arguments](const CommonOptions& common) { return run_refine(*arguments, common); }};
}

}  // namespace doppel::tools
