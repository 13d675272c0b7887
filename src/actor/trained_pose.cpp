#include "doppel/actor/trained_pose.h"

#include "doppel/actor/run_folder.h"
#include "doppel/actor/stored_stage.h"
#include "doppel/core/error.h"

namespace doppel {

namespace fs = std::filesystem;

TrainedPose TrainedPose::load(const fs::path& run, const std::optional<fs::path>& capture, bool with_defnet) {
  if (!fs::exists(RunFolder(run).config()))
    fail("{} is not a run: it holds no config.yaml; give the --out folder of `doppel train`", run.string());
  const auto stored = find_stage(run, "posenet");
  if (!stored) fail("{} has no checkpoint of posenet yet; train it first", run.string());
  const ConfigReader root = stored->config.root(), model = root.section("model");
  TrainedPose trained;
  trained.subject = RunSubject::read(stored->config, root, "posenet");
  const RunSubject subject = run_subject(run);  // posenet may be that of another run
  trained.subject.capture = subject.capture;
  trained.subject.validation = subject.validation;
  if (capture) trained.subject.use_capture(*capture);
  trained.detections = read_options<DetectionOptions>(root.section("loss"));
  trained.trained_on_cameras = root.section("data").list<std::string>("cameras");
  const Dataset dataset = Dataset::open(trained.subject.capture);
  trained.character = load_character(dataset.character_path(), trained.subject.character);
  check_character(*stored, trained.character, run, dataset.character_path());
  dataset.require_landmarks();
  trained.landmarks = dataset.landmarks();
  trained.pose.emplace(trained.character.skeleton, model.list<std::string>("dofs"), trained.character.rest_dofs);
  trained.landmark_layer = Landmarks(trained.character.skeleton, trained.landmarks);
  trained.surface = CharacterSurface(trained.character);
  trained.posenet = PoseNet(*trained.pose, read_options<PoseNetConfig>(model));
  load_evaluation_weights(*trained.posenet, stored->checkpoint);
  trained.steps["posenet"] = stored->step;
  if (!with_defnet) return trained;
  if (const auto deformation = find_stage(run, "defnet")) {
    trained.defnet = DefNet(trained.character.num_nodes(),
                            read_options<BackboneConfig>(deformation->config.root().section("model")));
    load_evaluation_weights(*trained.defnet, deformation->checkpoint);
    trained.steps["defnet"] = deformation->step;
  }
  return trained;
}

CapturedPose TrainedPose::capture(const PersonView& view) {
  const torch::NoGradGuard no_grad;
  return capture_pose(posenet, *pose, landmark_layer, view, detections.alignment);
}

torch::Tensor TrainedPose::dofs(const CapturedPose& captured) const {
  return pose->dofs(captured.theta, captured.rotation, captured.position);
}

std::pair<torch::Tensor, torch::Tensor> TrainedPose::deformation(const torch::Tensor& image) {
  const torch::NoGradGuard no_grad;
  if (defnet) return defnet->forward(image);
  const torch::Tensor none = torch::zeros({image.size(0), character.num_nodes(), 3}, image.options());
  return {none, none};
}

std::string TrainedPose::digest() const { return fmt::format("posenet {:08x}", weights_checksum(*posenet)); }

}  // namespace doppel
