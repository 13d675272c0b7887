#include <algorithm>
#include <cstdio>

#include "character_create.h"
#include "character_fit.h"
#include "character_import.h"
#include "character_label.h"
#include "character_report.h"
#include "command.h"
#include "doppel/character/character_folder.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

struct BuildOptions {
  std::string mesh, skeleton, skin, motion, graph, segmentation, out, name;
  std::string metric = "hops", bone_rule = "exact", units = "mm";
  int nodes = 500;
};

CharacterOptions character_options(const BuildOptions& options) {
  CharacterOptions result;
  result.bone_rule = options.bone_rule == "prefix" ? BoneRule::prefix : BoneRule::exact;
  result.graph.metric = options.metric == "geodesic" ? GraphMetric::geodesic : GraphMetric::hops;
  result.num_nodes = options.nodes;
  return result;
}

/// Checks the unit: a person is between 20 cm and 5 m across in any pose. A wrong unit could otherwise remain unnoticed
/// through days of training.
void check_size(const TriangleMesh& mesh, const BuildOptions& options) {
  Eigen::Vector3d low = mesh.vertices[0], high = mesh.vertices[0];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  const double size = (high - low).maxCoeff();
  if (size < 0.2 || size > 5.0)
    fail<UsageError>(
        "{} is {:.4g} m across if its unit is {}; a person is between 0.2 m and 5 m across. Try --units {}",
        options.mesh, size, options.units, options.units == "mm" ? "m" : "mm");
}

Character build(const BuildOptions& options) {
  const double metres_per_unit = options.units == "m" ? 1.0 : 0.001;
  Character character;
  character.name = options.name.empty() ? fs::path(options.mesh).stem().string() : options.name;
  check_character_name(character.name);
  character.options = character_options(options);
  character.mesh = read_obj(options.mesh, metres_per_unit);
  check_size(character.mesh, options);
  character.skeleton = read_skeleton(options.skeleton);
  if (!options.motion.empty()) character.rest_dofs = read_motion(options.motion, character.num_dofs()).frames[0];
  character.skin = read_skin(options.skin, character.num_vertices());
  if (!options.segmentation.empty())
    character.labels = read_segmentation(options.segmentation, character.num_vertices());
  complete_character(character);
  decide_marker_reading(character.skeleton, character.rest_dofs, character.mesh);
  if (const double distance = skeleton_distance(character); distance > kSkeletonOffTemplate)
    log::warn("in the rest pose the joints lie {:.3g} m from the template (median): {}", distance,
              options.motion.empty() ? "without --motion all DoFs are 0; was the template scanned in another pose?"
                                     : "is the first frame of --motion the pose the template was scanned in?");
  character.graph_source = options.graph;
  character.graph = options.graph.empty() ? build_graph(character.mesh, options.nodes, character.options.graph)
                                          : build_graph(character.mesh, read_obj(options.graph, metres_per_unit),
                                                        character.options.graph);
  return character;
}

int run_build(const BuildOptions& options, const CommonOptions& common) {
  const Character character = build(options);
  const fs::path path = write_character(options.out, character);
  nlohmann::ordered_json report;
  report["written"] = path.string();
  report.update(describe_character(character, false));
  print_report(report, common.json);
  return 0;
}

void add_build_options(CLI::App& app, BuildOptions& options) {
  const auto file = [&](const char* name, std::string& value, const char* help) {
    return app.add_option(name, value, help);
  };
  file("--mesh", options.mesh, "Template mesh in the rest pose, OBJ")->required();
  file("--skeleton", options.skeleton, "Skeletool skeleton (always millimetres)")->required();
  file("--skin", options.skin, "Skeletool skinning weights")->required();
  file("--motion", options.motion, "Motion whose first frame is the rest pose (default: all DoFs 0)");
  CLI::Option* graph =
      file("--graph", options.graph, "Coarse mesh of the template, OBJ, whose vertices become graph nodes");
  app.add_option("--nodes", options.nodes,
                 "Number of graph nodes without --graph; the template is decimated to this number")
      ->check(CLI::Range(4, 100000))
      ->excludes(graph)
      ->capture_default_str();
  file("--segmentation", options.segmentation, "Label 0..20 of each vertex, one per line (default: none, rigidity 1)");
  app.add_option("--metric", options.metric, "Distance along the template for the weights of graph nodes")
      ->check(CLI::IsMember({"hops", "geodesic"}))
      ->capture_default_str();
  app.add_option("--bone-rule", options.bone_rule, "How a bone of the skinning weights finds its joint by name")
      ->check(CLI::IsMember({"exact", "prefix"}))
      ->capture_default_str();
  app.add_option("--units", options.units, "Length unit of the OBJ files")
      ->check(CLI::IsMember({"mm", "m"}))
      ->capture_default_str();
  app.add_option("--name", options.name, "Name of the character and its files (default: that of the mesh)");
  app.add_option("--out", options.out, "Folder to write")->required();
}

}  // namespace

Command add_character(CLI::App& program) {
  auto options = std::make_shared<BuildOptions>();
  CLI::App* app =
      program.add_subcommand("character", "Create, fit, import or build characters and label their materials");
  app->require_subcommand(1);
  CLI::App* build_app =
      app->add_subcommand("build", "Make a character folder from a mesh, a skeleton and skinning weights");
  build_app->fallthrough();
  add_build_options(*build_app, *options);
  const Command create = add_character_create(*app), fit = add_character_fit(*app), import = add_character_import(*app),
                label = add_character_label(*app);
  app->footer(
      "Examples: doppel character create --help; doppel character fit --help; doppel character import --help; "
      "doppel character build --help; "
      "doppel character label --help");
  build_app->footer(
      "Example: doppel character build --mesh actor.obj --skeleton actor.skeleton --skin actor.skin --motion "
      "rest.motion "
      "--nodes 500 --out actor/");
  return {app, [options, create, fit, import, label](const CommonOptions& common) {
            for (const Command& command : {create, fit, import, label})
              if (command.app->parsed()) return command.run(common);
            return run_build(*options, common);
          }};
}

}  // namespace doppel::tools
