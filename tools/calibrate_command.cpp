#include <fmt/ranges.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "calibrate_subcommands.h"
#include "command.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/calibration/formats/relative_intrinsics.h"
#include "doppel/core/error.h"

namespace doppel::tools {

namespace {

struct ConvertArguments {
  std::string from, to, format, unit, up, size, subject;
};

/// "1920x1080" as width and height.
std::pair<int, int> parse_size(const std::string& text) {
  int width = 0, height = 0, length = 0;
  const int found = std::sscanf(text.c_str(), "%6dx%6d%n", &width, &height, &length);
  if (found != 2 || length != static_cast<int>(text.size()) || width < 1 || height < 1)
    fail<UsageError>("--size is \"{}\"; expected WIDTHxHEIGHT in pixels, for instance 1920x1080", text);
  return {width, height};
}

void complete_sizes(Calibration& calibration, const ConvertArguments& arguments) {
  for (Camera& camera : calibration.cameras) {
    if (camera.width > 0) continue;
    if (arguments.size.empty())
      fail<UsageError>("{} does not state the size of camera {}'s images; add --size WIDTHxHEIGHT", arguments.from,
                       camera.name);
    const auto [width, height] = parse_size(arguments.size);
    camera = with_image_size(camera, width, height);
  }
}

int convert(const ConvertArguments& arguments, const CommonOptions& common) {
  Calibration calibration = load_calibration(arguments.from, {arguments.unit, arguments.up, arguments.subject});
  if (!calibration.has_poses)
    fail("{} ({}) holds intrinsics only; a calibration also needs the poses of the cameras", arguments.from,
         calibration.format);
  complete_sizes(calibration, arguments);
  write_calibration(arguments.to, calibration.cameras, arguments.format);
  if (common.json) {
    const nlohmann::ordered_json report{{"from", calibration.format},
                                        {"to", arguments.to},
                                        {"unit", calibration.unit},
                                        {"up", calibration.up},
                                        {"cameras", calibration.cameras.size()},
                                        {"notes", calibration.notes}};
    fmt::print("{}\n", report.dump(2));
    return 0;
  }
  fmt::print("{}: {} cameras read as {} (unit {}, up {})\n{}: written in metres, y up\n", arguments.from,
             calibration.cameras.size(), calibration.format, calibration.unit, calibration.up, arguments.to);
  for (const std::string& note : calibration.notes) fmt::print("note: {}\n", note);
  return 0;
}

}  // namespace

Command add_calibrate(CLI::App& program) {
  CLI::App* app = program.add_subcommand("calibrate", "Make, mend and convert camera calibrations");
  app->require_subcommand(1);
  auto arguments = std::make_shared<ConvertArguments>();
  CLI::App* convert_app = app->add_subcommand("convert", "Write a calibration in another format");
  convert_app->fallthrough();
  // CLI11 2.4 counts the names of positional arguments and options together, so `to` would clash with `--to`.
  convert_app->add_option("source", arguments->from, "Calibration file or folder, of any known format")->required();
  convert_app->add_option("target", arguments->to, "File, or new folder, to write")->required();
  convert_app->add_option("--to", arguments->format,
                          fmt::format("Format to write: {} (default: by the extension of the file)",
                                      fmt::join(calibration_writers(), ", ")));
  convert_app->add_option("--unit", arguments->unit, "Unit of the file, if it does not state it: m, cm or mm");
  convert_app->add_option("--up", arguments->up, "Axis of the file that points up, if it does not state it: +x ... -z");
  convert_app->add_option("--subject", arguments->subject,
                          "Subject whose cameras to read, if the file holds those of several (default: by its folder)");
  convert_app->add_option("--size", arguments->size, "WIDTHxHEIGHT of the images, if the file does not state it");
  convert_app->footer("Example: doppel calibrate convert Calib_qualisys.toml cameras.yml");
  const std::vector<Command> others{add_calibrate_board(*app), add_calibrate_sync(*app), add_calibrate_refine(*app),
                                    add_calibrate_world(*app)};
  app->footer("Example: doppel calibrate convert colmap/sparse/0 cameras.yml");
  return {app, [arguments, others](const CommonOptions& common) {
            for (const Command& other : others)
              if (other.app->parsed()) return other.run(common);
            return convert(*arguments, common);
          }};
}

}  // namespace doppel::tools
