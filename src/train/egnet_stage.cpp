#include "doppel/train/egnet_stage.h"

#include "doppel/render/mesh/face_tensor.h"
#include "doppel/train/stage_table.h"

namespace doppel {

namespace {

/// Enough frames for statistics; more would only need more memory.
constexpr std::size_t kEgNetStatisticsFrames = 2048;
/// Lower bound of the standard deviation of an input, metres and radians.
constexpr double kEgNetFeatureFloor = 0.01;

}  // namespace

EgNetStage::EgNetStage(const Dataset& dataset, const Character& character, const EgNetRunConfig& config)
    : CaptureStage(dataset, character, config.loader),
      config_(config),
      network_(character, config.model,
               at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      surface_(character),
      arap_graph_(character),
      faces_(face_tensor(character.mesh)),
      noise_(character.skeleton, config.noise) {
  if (!config_.standardise) return;
  const auto [mean, std] =
      input_statistics(training_windows(kEgNetStatisticsFrames, config_.model.past_frames),
                       [this](const torch::Tensor& windows) { return network_->network_input(windows); });
  network_->set_input_statistics(mean, std, kEgNetFeatureFloor);
}

LossTerms EgNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  const torch::Tensor dofs = batch.dofs.select(1, -1).contiguous();
  torch::Tensor A, T, vertices, arap;
  {
    ProfileScope scope(profile, "network");
    std::tie(A, T) =
        network_->forward(noise_.apply(batch.dofs, *network_, context.generator, context.share), batch.dofs);
  }
  {
    ProfileScope scope(profile, "layers");
    vertices = surface_->deformed(dofs, A, T);
  }
  const SilhouetteLoss silhouette = batch_silhouette_loss(vertices, faces_, batch, config_.silhouette, profile);
  {
    ProfileScope scope(profile, "arap");
    arap = arap_loss(A, T, arap_graph_);
  }
  const auto views = [batch] { return silhouette_views(batch); };
  LossTerms terms{{"model_to_data", silhouette.model_to_data, config_.silhouette_weight, views},
                  {"data_to_model", silhouette.data_to_model, config_.silhouette_weight, views},
                  {"arap", arap, config_.arap_weight}};
  if (config_.anchor_weight > 0.0) {
    ProfileScope scope(profile, "anchor");
    terms.push_back({"anchor", anchor_loss(vertices, surface_->skinned(dofs)), config_.anchor_weight});
  }
  return terms;
}

void EgNetStage::prepare_evaluation() {
  if (!config_.recalibrate_norm || config_.model.sagcn.norm == SagcnNorm::none) return;
  // In training mode, a forward pass mixes a share `momentum` of the batch's statistics into the running ones. When
  // these start at zero, one pass over all frames gives momentum * (statistics of the whole set).
  std::vector<torch::Tensor> running;
  for (const auto& item : network_->named_buffers())
    if (item.key().find("running_") != std::string::npos && item.value().defined()) running.push_back(item.value());
  const torch::Tensor windows = training_windows(kEgNetStatisticsFrames, config_.model.history());
  if (windows.size(0) < 2) return;
  for (torch::Tensor& buffer : running) buffer.zero_();
  network_->train();
  network_->forward(windows);
  for (torch::Tensor& buffer : running) buffer.div_(config_.model.sagcn.norm_momentum);
}

std::vector<ReportImage> EgNetStage::images() {
  return outline_images(faces_, "skinning blue, EGNet red", [this](const SampleId& sample) {
    const torch::Tensor window = dataset().dof_window(sample, config_.model.history()).unsqueeze(0);
    const auto [A, T] = network_->forward(window);
    const torch::Tensor dofs = window.select(1, -1).contiguous();
    return std::make_pair(surface_->skinned(dofs)[0], surface_->deformed(dofs, A, T)[0]);
  });
}

namespace {

void evaluate_egnet(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  rows["egnet"] = evaluate_actor_surface(evaluation, "egnet", &TrainedActor::coarse);
}

}  // namespace

StageEntry egnet_entry() {
  return {"egnet",
          {"egnet", "ddc", "hybrid"},
          {},
          [](const ConfigDocument& document) { EgNetRunConfig::read(document); },
          train_first<EgNetStage, EgNetRunConfig>,
          evaluate_egnet};
}

}  // namespace doppel
