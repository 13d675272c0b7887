#include "character_import.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "character_report.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/motions_json.h"
#include "doppel/io/scene/read_scene.h"

namespace doppel::tools {
namespace {

struct ImportOptions {
  std::string rig, out, name = "actor", unit, up;
  std::vector<std::string> animations;
  double fps = 0.0, limit = 180.0;
  int nodes = 500;
  bool weld = false;
};

ImportRigOptions rig_options(const ImportOptions& options) {
  static const std::map<std::string, double> kUnits{{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}};
  ImportRigOptions result;
  result.name = options.name;
  result.animations = options.animations;
  if (!options.unit.empty()) result.metres_per_unit = kUnits.at(options.unit);
  if (!options.up.empty()) result.up = options.up[0];
  result.frames_per_second = options.fps;
  result.joint_limit = options.limit * (M_PI / 180);
  result.nodes = options.nodes;
  result.weld = options.weld;
  return result;
}

nlohmann::ordered_json describe_import(const ImportedRig& rig, const std::filesystem::path& written) {
  nlohmann::ordered_json report;
  report["written"] = written.string();
  report["vertices"] = rig.character.num_vertices();
  report["triangles"] = rig.character.mesh.num_faces();
  report["joints"] = rig.joints.size();
  report["dofs"] = rig.character.num_dofs();
  report["landmarks"] =
      std::count_if(rig.landmark_joint.begin(), rig.landmark_joint.end(), [](int j) { return j >= 0; });
  report["motions"] = motions_json(rig);
  report["warnings"] = rig.warnings;
  return report;
}

int run_import(const ImportOptions& options, const CommonOptions& common) {
  const FolderLock lock(options.out);
  const ImportedRig rig = import_rig(read_scene(options.rig), rig_options(options));
  for (const std::string& warning : rig.warnings) log::warn("{}: {}", options.rig, warning);
  const std::filesystem::path written = write_imported_rig(options.out, rig);
  print_report(describe_import(rig, written), common.json);
  return 0;
}

}  // namespace

Command add_character_import(CLI::App& character) {
  auto options = std::make_shared<ImportOptions>();
  CLI::App* app = character.add_subcommand(
      "import", "Make a character and motions from a rigged figure: glTF, GLB, VRM, FBX or Collada");
  app->fallthrough();
  app->add_option("rig", options->rig, "The file of the rigged figure")->required();
  app->add_option("--out", options->out, "Folder to write")->required();
  app->add_option("--animation", options->animations, "Name of an animation to import; may be repeated (default: all)");
  app->add_option("--fps", options->fps,
                  "Frames per second of the motions (default: so many that every key has a frame, 100 to 600)")
      ->check(CLI::Range(0.1, 10000.0));
  app->add_option("--unit", options->unit, "Unit of the file (default: as it says, else by the height)")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}));
  app->add_option("--up", options->up, "Vertical axis of the file (default: as it says, else y)")
      ->check(CLI::IsMember({"x", "y", "z"}));
  app->add_option("--limit", options->limit, "Limit of every rotation but the root's, degrees")
      ->check(CLI::Range(1.0, 180.0))
      ->capture_default_str();
  app->add_option("--nodes", options->nodes, "Number of graph nodes")
      ->check(CLI::Range(4, 100000))
      ->capture_default_str();
  app->add_flag("--weld", options->weld,
                "Join vertices that coincide in every pose, such as those along seams of the texture (for training)");
  app->add_option("--name", options->name, "Name of the character and its files")->capture_default_str();
  app->footer(
      "Examples:\n"
      "  doppel character import figure.glb --out figure\n"
      "  doppel animate --character figure/actor.character --motion figure/Walking.motion --format npy --out walking");
  return {app, [options](const CommonOptions& common) { return run_import(*options, common); }};
}

}  // namespace doppel::tools
