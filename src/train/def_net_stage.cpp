#include "doppel/train/def_net_stage.h"

#include "doppel/core/error.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/train/stage_table.h"

namespace doppel {

void describe_keys(const Keys& keys, DefNetRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  describe_keys(keys.section("model"), c.model);
  keys("loss.silhouette", c.silhouette_weight, at_least(0.0), "weight, thesis A.1.2");
  keys("loss.keypoints", c.keypoint_weight, at_least(0.0), "weight, thesis A.1.2");
  keys("loss.arap", c.arap_weight, at_least(0.0), "weight, thesis A.1.2");
  describe_keys(keys.section("loss"), c.silhouette);
  describe_keys(keys.section("train"), c.trainer);
}

DefNetRunConfig DefNetRunConfig::read(const ConfigDocument& document) {
  return read_run<DefNetRunConfig>(document, "defnet");
}

DefNetStage::DefNetStage(const Dataset& dataset, TrainedPose& pose, const DefNetRunConfig& config)
    : CaptureStage(dataset, pose.character, with_people(config.loader, pose.input_size())),
      pose_(pose),
      config_(config),
      network_(pose.character.num_nodes(), config.model,
               at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      graph_landmarks_(pose.character, pose.landmarks),
      arap_graph_(pose.character),
      faces_(face_tensor(pose.character.mesh)) {
  if (config.model.input_size != pose.input_size())
    fail<UsageError>("defnet: model.input_size is {}, PoseNet's is {}; both must be equal", config.model.input_size,
                     pose.input_size());
}

LossTerms DefNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  torch::Tensor dofs, counts, A, T, vertices, landmarks;
  {
    ProfileScope scope(profile, "network");
    const CapturedPose captured = pose_.capture(person_view(batch));
    dofs = pose_.dofs(captured);
    counts = captured.valid & batch.person_valid;
    std::tie(A, T) = network_->forward(batch.person.select(1, 0));
  }
  {
    ProfileScope scope(profile, "layers");
    vertices = pose_.surface->deformed(dofs, A, T);
    landmarks = graph_landmarks_->forward(A, T, pose_.surface->node_transforms(dofs));
  }
  Batch placed = batch;  // views without a position cannot be compared
  placed.valid = batch.valid & counts.unsqueeze(1);
  const SilhouetteLoss silhouette = batch_silhouette_loss(vertices, faces_, placed, config_.silhouette, profile);
  ProfileScope scope(profile, "keypoints");
  const KeypointTarget target = keypoint_target(batch, counts);
  return {{"silhouette", silhouette.total(), config_.silhouette_weight, [placed] { return silhouette_views(placed); }},
          {"keypoints", keypoint_loss(landmarks, target, {}, pose_.detections.loss), config_.keypoint_weight,
           [this, landmarks, target] {
             return static_cast<double>(keypoint_cameras(landmarks, target, pose_.detections.loss));
           }},
          {"arap", arap_loss(A, T, arap_graph_), config_.arap_weight}};
}

std::vector<ReportImage> DefNetStage::images() {
  return outline_images(faces_, "PoseNet blue, with DefNet red", [this](const SampleId& sample) {
    const Batch batch = person_batch(dataset(), sample, loader_options());
    const torch::Tensor dofs = pose_.dofs(pose_.capture(person_view(batch)));
    const auto [A, T] = network_->forward(batch.person.select(1, 0));
    return std::make_pair(pose_.surface->skinned(dofs)[0], pose_.surface->deformed(dofs, A, T)[0]);
  });
}

StageEntry def_net_entry() {
  return {"defnet",
          {"deepcap"},
          {"posenet"},
          [](const ConfigDocument& document) { DefNetRunConfig::read(document); },
          [](const StageTask& task) {
            return train_on<DefNetStage, DefNetRunConfig>(
                TrainedPose::load(task.run, std::nullopt, /*with_defnet=*/false), task);
          },
          nullptr};
}

}  // namespace doppel
