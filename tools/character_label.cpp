#include "character_label.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "character_report.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/labels.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/vertex_labels.h"
#include "doppel/layers/surface.h"
#include "number_checks.h"

namespace doppel::tools {
namespace {

struct LabelOptions {
  std::string character, calibration, images, legend, motion, out;
  int frame = 0;
};

/// The template in its rest pose, or in the pose of `--motion`.
std::vector<Eigen::Vector3d> posed_vertices(const Character& character, const LabelOptions& options) {
  if (options.motion.empty()) return character.mesh.vertices;
  const Motion motion = read_motion(options.motion, character.num_dofs());
  if (options.frame >= motion.num_frames())
    fail<UsageError>("--frame {} is not in {}, which has frames 0 to {}", options.frame, options.motion,
                     motion.num_frames() - 1);
  const torch::NoGradGuard no_grad;
  const torch::Tensor dofs = torch::tensor(motion.frames[options.frame], torch::kFloat64);
  const torch::Tensor skinned = CharacterSurface(character)->skinned(dofs.unsqueeze(0)).contiguous();
  std::vector<Eigen::Vector3d> vertices(character.num_vertices());
  const double* x = skinned.data_ptr<double>();
  for (Eigen::Vector3d& vertex : vertices)
    for (double& value : vertex) value = *x++;
  return vertices;
}

int run_label(const LabelOptions& options, const CommonOptions& common) {
  const Character character = load_character(options.character);
  const LabelLegend legend = options.legend.empty() ? LabelLegend() : LabelLegend::read(options.legend);
  const std::vector<LabelView> views = read_label_views(options.images, read_calibration(options.calibration), legend);
  const VertexLabels found = label_vertices(character, posed_vertices(character, options), views);
  write_segmentation(options.out, found.labels);
  std::array<int, kNumLabels> count{};
  for (const int label : found.labels) ++count[label];
  nlohmann::ordered_json report;
  report["written"] = options.out;
  report["views"] = views.size();
  report["vertices"] = found.labels.size();
  report["seen"] = found.voted;
  for (std::size_t label = 0; label < count.size(); ++label)
    if (count[label] > 0) report["labels"][label_names()[label]] = count[label];
  print_report(report, common.json);
  return 0;
}

}  // namespace

Command add_character_label(CLI::App& character) {
  auto options = std::make_shared<LabelOptions>();
  CLI::App* app = character.add_subcommand(
      "label", "Find the label of every vertex from label images of several views, by majority vote");
  app->fallthrough();
  app->add_option("character", options->character, "The .character file")->required();
  app->add_option("--calibration", options->calibration, "Cameras of the label images")->required();
  app->add_option("--images", options->images, "Folder of label images, each named after its camera (007.png)")
      ->required();
  app->add_option("--legend", options->legend,
                  "YAML: label name: grey value or [red, green, blue] (default: grey values are labels 0..20)");
  CLI::Option* motion = app->add_option("--motion", options->motion,
                                        "Motion that contains the pose of the images (default: the rest pose)");
  app->add_option("--frame", options->frame, "Frame of --motion that the images show")
      ->check(not_negative())
      ->needs(motion)
      ->capture_default_str();
  app->add_option("--out", options->out,
                  "File to write; a segmentation.txt next to the mesh is read with the character")
      ->required();
  app->footer(
      "Example: doppel character label actor/actor.character --calibration scan.calibration --images parsed/ "
      "--legend lip.yaml --out actor/segmentation.txt");
  return {app, [options](const CommonOptions& common) { return run_label(*options, common); }};
}

}  // namespace doppel::tools
