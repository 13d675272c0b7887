#include "doppel/train/pose_net_stage.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/character/landmarks.h"
#include "doppel/character/observable_dofs.h"
#include "doppel/core/log.h"
#include "doppel/losses/limits.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/train/stage_table.h"

namespace doppel {

namespace {

/// The dataset's landmarks. @throws UsageError that says how to get them
const std::vector<Marker>& landmarks_of(const Dataset& dataset) {
  dataset.require_landmarks();
  return dataset.landmarks();
}

/// The DoFs to predict: those that the configuration names, or else the joint angles of its choice.
std::vector<std::string> dofs_to_predict(const PoseNetRunConfig& config, const Dataset& dataset,
                                         const Character& character) {
  if (!config.dofs.empty()) return config.dofs;
  const std::vector<int> dofs = config.angles == AngleChoice::all
                                    ? joint_angles(character.skeleton)
                                    : determined_dofs(character.skeleton, landmarks_of(dataset), character.rest_dofs);
  std::vector<std::string> names;
  for (const int dof : dofs) names.push_back(character.skeleton.dofs[dof].name);
  return PoseDofs(character.skeleton, names, character.rest_dofs).names();  // without those of the root
}

}  // namespace

void describe_keys(const Keys& keys, PoseNetRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  keys("model.dofs", c.dofs,
       "names of the DoFs to predict; `*` stands for any characters, a leading `!` removes; empty: `angles`");
  keys("model.angles", c.angles, {"determined", "all"},
       "the joint angles that landmarks determine, or all, as in the thesis; no effect with `dofs`");
  describe_keys(keys.section("model"), c.model);
  describe_keys(keys.section("loss"), c.detections);
  describe_keys(keys, c.phases);
  describe_phased(keys.section("train"), c.trainer, c.phases.schedule(),
                  "the stage posenet takes this from its `phases`");
}

PoseNetRunConfig PoseNetRunConfig::read(const ConfigDocument& document) {
  PoseNetRunConfig config = read_run<PoseNetRunConfig>(document, "posenet");
  config.loader = with_people(config.loader, config.model.input_size);
  return config;
}

PoseNetStage::PoseNetStage(const Dataset& dataset, const Character& character, const PoseNetRunConfig& config)
    : CaptureStage(dataset, character, config.loader),
      config_(config),
      pose_(character.skeleton, dofs_to_predict(config, dataset, character), character.rest_dofs),
      landmarks_(character.skeleton, landmarks_of(dataset)),
      landmark_names_(landmark_names(dataset.landmarks())),
      network_(pose_, config.model, at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      surface_(character),
      faces_(face_tensor(character.mesh)) {
  const bool known = std::any_of(landmark_names_.begin(), landmark_names_.end(),
                                 [](const std::string& name) { return landmark_kind(name) != LandmarkKind::other; });
  if (!known)
    log::warn(
        "posenet: no landmark name names the neck, a shoulder, hip, elbow or knee ({}), so all landmarks have the same "
        "weight, and training does not begin with the torso (5.6)",
        fmt::join(landmark_names_, ", "));
}

CapturedPose PoseNetStage::capture(const Batch& batch) {
  return capture_pose(network_, pose_, landmarks_, person_view(batch), config_.detections.alignment);
}

LossTerms PoseNetStage::loss(const Batch& batch, StepContext& context) {
  CapturedPose captured;
  {
    ProfileScope scope(*context.profile, "network");
    captured = capture(batch);
  }
  ProfileScope scope(*context.profile, "keypoints");
  const PosePhases::Position position = config_.phases.at(context.step);
  const KeypointTarget target = keypoint_target(batch, captured.valid & batch.person_valid);
  return {{"keypoints",
           keypoint_loss(captured.landmarks, target, landmark_weights(landmark_names_, position.progress),
                         config_.detections.loss),
           position.phase->keypoints,
           [this, points = captured.landmarks, target] {
             return static_cast<double>(keypoint_cameras(points, target, config_.detections.loss));
           }},
          {"limits", limits_loss(captured.theta, pose_.lower(), pose_.upper()),
           position.phase->limits_weight(position.progress)}};
}

std::vector<ReportImage> PoseNetStage::images() {
  const std::string legend = "the capture's own motion blue (where it has one), PoseNet red";
  return outline_images(faces_, legend, [this](const SampleId& sample) {
    const Batch batch = person_batch(dataset(), sample, loader_options());
    const CapturedPose captured = capture(batch);
    const torch::Tensor dofs = pose_.dofs(captured.theta, captured.rotation, captured.position);
    const torch::Tensor found = surface_->skinned(dofs)[0];
    if (!batch.dofs.defined()) return std::make_pair(found, found);
    return std::make_pair(surface_->skinned(batch.dofs.select(1, -1).contiguous())[0], found);
  });
}

namespace {

/// The run's configuration names the DoFs that the network predicts, so the run does not depend on a capture's
/// landmarks.
TrainSummary train_pose_net(const StageTask& task) {
  const PoseNetRunConfig config = PoseNetRunConfig::read(task.document);
  const Dataset dataset = config.subject.open_dataset();
  const Character character = load_character(dataset.character_path(), config.subject.character);
  const std::string dofs =
      fmt::format("model.dofs=[\"{}\"]", fmt::join(dofs_to_predict(config, dataset, character), "\", \""));
  StageTask named = task;
  named.resolved = ConfigDocument::parse(task.resolved, task.document.path().string(), {dofs}).resolved();
  return train_first<PoseNetStage, PoseNetRunConfig>(named);
}

}  // namespace

StageEntry pose_net_entry() {
  return {"posenet",
          {"posenet", "deepcap"},
          {},
          [](const ConfigDocument& document) { PoseNetRunConfig::read(document); },
          train_pose_net,
          nullptr};
}

}  // namespace doppel
