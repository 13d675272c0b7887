#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "calibrate_rig.h"
#include "calibrate_subcommands.h"
#include "doppel/calibration/estimation/world_by_person.h"
#include "doppel/core/angles.h"
#include "doppel/detect/keypoints/keypoints.h"

namespace doppel::tools {

namespace {

struct WorldArguments {
  std::string capture, sequence, out;
  double height = 0.0;  ///< metres; 0: not given
};

BodyPointIndices indices_of(const std::vector<std::string>& names) {
  const PointLayout layout{"", names};
  const auto pair = [&](const std::string& part) {
    return BodyPointIndices::Pair{layout.find("left_" + part).value_or(-1), layout.find("right_" + part).value_or(-1)};
  };
  BodyPointIndices points{pair("shoulder"), pair("hip"), pair("knee"), pair("ankle"), pair("heel"), pair("big_toe")};
  for (const std::size_t side : {0U, 1U})
    if (points.toes[side] < 0) points.toes[side] = pair("foot_index")[side];
  return points;
}

int run_world(const WorldArguments& arguments, const CommonOptions& common) {
  RigFootage footage = open_rig_footage(arguments.capture, arguments.sequence);
  const std::filesystem::path out = calibration_to_write(footage.capture, arguments.out, "_world");
  check_refined_target(out, footage.capture);
  read_tracks(footage);
  WorldOptions options;
  if (arguments.height > 0.0) options.stature = arguments.height;
  const WorldByPerson found =
      world_by_person(footage.filmed.cameras, footage.tracks, indices_of(footage.tracks.points), options);
  std::vector<Camera> cameras = calibrated_cameras(footage.capture);
  for (Camera& camera : cameras) camera = transformed(camera, found.world);
  write_result(out, cameras);
  if (common.json) {
    const nlohmann::ordered_json report{{"out", out.string()},        {"scale", found.world.scale},
                                        {"scaled", found.scaled},     {"turn_deg", found.turn / kRadiansPerDegree},
                                        {"stature_m", found.stature}, {"floor_spread_mm", 1000.0 * found.floor_spread}};
    std::printf("%s\n", report.dump(2).c_str());
    return 0;
  }
  std::printf("up         %.1f degrees from the old +y\n", found.turn / kRadiansPerDegree);
  std::printf("person     %.2f m tall by legs and trunk\n", found.stature);
  if (found.scaled)
    std::printf("unit       1 of the old world is %.4g m\n", found.world.scale);
  else
    std::printf("unit       metres, as it was\n");
  std::printf("floor      y = 0; standing feet are %.0f mm off (root mean square)\n", 1000.0 * found.floor_spread);
  std::printf("written: %s\n", out.string().c_str());
  print_keys_to_remove(footage.capture);
  return 0;
}

}  // namespace

Command add_calibrate_world(CLI::App& calibrate) {
  CLI::App* app = calibrate.add_subcommand(
      "world", "Find the floor, the up axis and the unit of a capture's calibration by the person who walks there");
  app->fallthrough();
  auto arguments = std::make_shared<WorldArguments>();
  app->add_option("capture", arguments->capture, "capture.yaml, or a folder that is recognised as a capture")
      ->required();
  app->add_option("--height", arguments->height,
                  "Height of the person in metres (default: the unit is kept; 1.7 if the person would be no person's "
                  "size)")
      ->check(CLI::Range(0.3, 3.0));
  app->add_option("--sequence", arguments->sequence, "Sequence whose keypoints are used (default: the first with any)");
  app->add_option(
      "--out", arguments->out,
      "Calibration to write: .yml, .toml or .calibration (default: NAME_world.yml beside the capture.yaml)");
  app->footer("Example: doppel calibrate world recordings/anna --height 1.68");
  return {app, [arguments](const CommonOptions& common) { return run_world(*arguments, common); }};
}

}  // namespace doppel::tools
