#include "character_create.h"

#include "character_report.h"
#include "doppel/character/character_folder.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/geometry/image_file.h"
#include "doppel/io/scene/read_scene.h"
#include "doppel/rigging/autorig/create_character.h"
#include "doppel/rigging/autorig/scan_of_scene.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

struct CreateOptions {
  std::string scan, out, unit, up, joints, name = "actor";
  int vertices = 6000, nodes = 500;
};

CreatedCharacter create(const CreateOptions& options, const CommonOptions& common) {
  Scene scene = read_scene(options.scan);
  for (const std::string& warning : scene.warnings) log::warn("{}: {}", options.scan, warning);
  CreateCharacterOptions creation;
  creation.orientation.unit = options.unit;
  creation.orientation.up = options.up;
  if (scene.up) creation.orientation.file_up = std::string(1, *scene.up);
  creation.orientation.file_unit = scene.metres_per_unit;
  if (!options.joints.empty()) creation.joints = options.joints;
  creation.vertices = options.vertices;
  creation.nodes = options.nodes;
  creation.points.detector.threads = resolve_threads(common.threads);
  const ScanParts scan = scan_of_scene(scene);
  scene = {};  // a scan may be large
  return create_character(options.name, scan, creation);
}

nlohmann::ordered_json describe_bending(const BendReport& bending) {
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
  };
  for (const PoseBend& bend : bending.poses)
    poses.push_back({{"pose", bend.pose},
                     {"stretched", bend.stretched},
                     {"stretched_share", static_cast<double>(bend.stretched) / bending.triangles},
                     {"stretched_alone", bend.stretched_alone},
                     {"stretched_alone_share", static_cast<double>(bend.stretched_alone) / bending.triangles},
                     {"largest_stretch", bend.largest_stretch},
                     {"sticking", bend.sticking},
                     {"elbow_volume", or_null(bend.elbow_volume)},
                     {"knee_volume", or_null(bend.knee_volume)}});
  return poses;
}

int run_create(const CreateOptions& options, const CommonOptions& common) {
  check_character_name(options.name);
  const FolderLock lock(options.out);
  const CreatedCharacter created = create(options, common);
  for (const std::string& note : created.notes) log::info("{}", note);
  std::vector<std::string> faults = created.doubts;
  for (const std::string& doubt : created.doubts) log::warn("{}; see joints.jpg", doubt);
  for (const std::string& fault : created.bending.faults()) {
    log::warn("{}; see poses.jpg", fault);
    faults.push_back(fault);
  }
  const fs::path written = write_character_folder(options.out, options.name, [&](const fs::path& folder) {
    write_character(folder, created.character);
    write_joints(folder / "joints.json", created.joints);
    write_image(folder / "joints.jpg", created.joint_sheet);
    write_image(folder / "poses.jpg", created.pose_sheet);
  });
  nlohmann::ordered_json report;
  report["written"] = written.string();
  report["notes"] = created.notes;
  report["warnings"] = faults;
  report["bending"] =
      common.json ? describe_bending(created.bending) : nlohmann::ordered_json(created.bending.summary());
  report.update(describe_character(created.character, false));
  print_report(report, common.json);
  return 0;
}

}  // namespace

Command add_character_create(CLI::App& character) {
  auto options = std::make_shared<CreateOptions>();
  CLI::App* app = character.add_subcommand(
      "create", "Make a character from a scan of a standing person: OBJ, PLY, STL, glTF, GLB, FBX or Collada");
  app->fallthrough();
  app->add_option("scan", options->scan, "The file of the scan")->required();
  app->add_option("--out", options->out, "Folder to write")->required();
  app->add_option("--unit", options->unit, "Unit of the file: m, cm, mm, inch, ... (default: found by the height)");
  app->add_option("--up", options->up, "Axis of the file that points up: y, +z, -x, ... (default: found by the shape)");
  app->add_option("--joints", options->joints,
                  "File of joints in the scan's coordinates, as joints.json (default: found in images of the scan)");
  app->add_option("--vertices", options->vertices, "Largest number of vertices of the template")
      ->check(CLI::Range(500, 1000000))
      ->capture_default_str();
  app->add_option("--nodes", options->nodes, "Number of graph nodes")
      ->check(CLI::Range(4, 100000))
      ->capture_default_str();
  app->add_option("--name", options->name, "Name of the character and its files")->capture_default_str();
  app->footer(
      "Examples:\n"
      "  doppel character create scan.obj --out anna\n"
      "  doppel character create scan.ply --unit mm --up z --out anna");
  return {app, [options](const CommonOptions& common) { return run_create(*options, common); }};
}

}  // namespace doppel::tools
