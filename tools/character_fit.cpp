#include "character_fit.h"

#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <vector>

#include "character_report.h"
#include "detected_capture.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/capture.h"
#include "doppel/geometry/image_file.h"
#include "doppel/rigging/body/body_shapes.h"
#include "doppel/track/shape/fit_character.h"

namespace doppel::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kLandmarksFile = "landmarks.csv";

struct FitOptions {
  std::string capture, out, config, name = "actor";
  std::vector<std::string> set;
  int vertices = 5000, nodes = 500;
  FitCharacterOptions fit;
};

void read_config(FitOptions& options) {
  const ConfigDocument document = options.config.empty() ? ConfigDocument::parse("{}", "the defaults", options.set)
                                                         : ConfigDocument::load(options.config, options.set);
  options.fit.config = read_track_config(document, options.fit.config);
}

Json measures_of(const ShapeFamily& family, const std::vector<double>& values) {
  Json json = Json::object();
  for (std::size_t p = 0; p < values.size(); ++p) json[family.parameters()[p].name] = values[p];
  return json;
}

Json report_of(const fs::path& written, const ShapeFamily& family, const FittedCharacter& fitted) {
  Json report;
  report["written"] = written.string();
  report["frames"] = fitted.poses.frames.size();
  report["keypoint_error_px"] = fitted.poses.keypoint_error;
  report["inlier_ratio"] = fitted.poses.inlier_ratio;
  report["IoU_of_measures"] = fitted.measured_overlap;
  report["IoU"] = fitted.poses.overlap;
  report["texture_coverage"] = fitted.texture_coverage;
  report["measures_m"] = measures_of(family, fitted.parameters);
  report.update(describe_character(fitted.character, false));
  return report;
}

/// The capture with this character and its landmarks, and the settings of the fit for `doppel track`, beside the
/// character.
void write_fitted_capture(const fs::path& out, const fs::path& character, const Footage& footage,
                          const MultiviewOptions& fit) {
  Capture capture = footage.capture();
  const fs::path folder = fs::absolute(character).lexically_normal().parent_path();
  capture.character = (folder / character.filename()).string();
  capture.landmarks = (folder / kLandmarksFile).string();
  for (SequenceEntry& entry : capture.sequences) entry.motion.clear();  // of another skeleton
  write_capture(out / "capture.yaml", capture,
                {"Written by `doppel character fit`: the capture with the fitted character."});
  write_atomically(out / "track.yaml",
                   fmt::format("# Written by `doppel character fit`: how keypoints, outlines and other frames count.\n"
                               "keypoints: {{weight: {}}}\nsilhouette: {{weight: {}, pixels: {}, vertices: {}}}\n"
                               "temporal: {{weight: {}}}\nsteady: {{weight: {}}}\n",
                               fit.keypoint_weight, fit.silhouette_weight, fit.outline_pixels, fit.outline_vertices,
                               fit.temporal_weight, fit.steady_weight));
}

int run_fit(FitOptions options, const CommonOptions& common) {
  check_character_name(options.name);
  read_config(options);
  const fs::path out = options.out;
  check_detect_out(options.capture, out);
  const FolderLock lock(out);
  const fs::path capture = with_keypoints(options.capture, out / "detected", {true, false}, common);
  const BodyModel model(options.vertices, options.nodes);
  const BodyShapes family(options.name, model);
  const auto footage = Footage::open_for(family.character(family.mean()), out / (options.name + ".character"), capture,
                                         options.fit.config.fit.outline_pixels);
  const FittedCharacter fitted = fit_character(family, *footage, options.fit);
  const fs::path written = write_character_folder(out, options.name, [&](const fs::path& folder) {
    write_character(folder, fitted.character);
    write_landmarks(folder / kLandmarksFile, fitted.character, fitted.landmarks);
    write_atomically(folder / "measures.json", measures_of(family, fitted.parameters).dump(2) + "\n");
    if (!fitted.sheet.empty()) write_image(folder / "fit.jpg", fitted.sheet);
  });
  write_fitted_capture(out, written, *footage, options.fit.config.fit);
  print_report(report_of(written, family, fitted), common.json);
  log::info("next: doppel track {} --config {} --out {}", out.string(), (out / "track.yaml").string(),
            (out / "tracked").string());
  return 0;
}

}  // namespace

Command add_character_fit(CLI::App& character) {
  auto options = std::make_shared<FitOptions>();
  CLI::App* app = character.add_subcommand(
      "fit", "Make a character from a capture alone: a body of measures, bent to the outlines, with a baked texture");
  app->fallthrough();
  FitCharacterOptions& fit = options->fit;
  app->add_option("capture", options->capture, "Capture folder or its capture.yaml; no character is needed")
      ->required();
  app->add_option("--out", options->out, "Folder to write")->required();
  app->add_option("--sequences", fit.sequences, "Names of the sequences to use (default: those for training)")
      ->delimiter(',');
  app->add_option("--frames", fit.frames, "Frames that the body is fitted to, spread over the sequences")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app->add_option("--bends", fit.bends, "How often the surface is bent to the outlines (0: only measures)")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  app->add_option("--texture-size", fit.texture_size, "Texels along each side of the texture (0: none)")
      ->check(CLI::Range(0, 8192))
      ->capture_default_str();
  app->add_option("--vertices", options->vertices, "Number of vertices of the template")
      ->check(CLI::Range(1000, 100000))
      ->capture_default_str();
  app->add_option("--nodes", options->nodes, "Number of graph nodes")
      ->check(CLI::Range(50, 10000))
      ->capture_default_str();
  app->add_option("--config", options->config, "Weights and thresholds of poses and surface (keys: docs/tracking.md)");
  app->add_option("--set", options->set, "Override a key of the configuration: --set silhouette.weight=0");
  app->add_option("--name", options->name, "Name of the character and its files")->capture_default_str();
  app->footer(
      "Example:\n"
      "  doppel character fit recordings/anna --out recordings/anna/actor\n"
      "  doppel track recordings/anna/actor --config recordings/anna/actor/track.yaml --out recordings/anna/tracked\n"
      "  doppel prepare recordings/anna/tracked --out prepared/anna");
  return {app, [options](const CommonOptions& common) { return run_fit(*options, common); }};
}

}  // namespace doppel::tools
