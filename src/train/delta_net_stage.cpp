#include "doppel/train/delta_net_stage.h"

#include <algorithm>

#include "doppel/actor/draw.h"
#include "doppel/core/error.h"
#include "doppel/losses/anchor.h"
#include "doppel/losses/images.h"
#include "doppel/render/shading/shading.h"
#include "doppel/train/image_sheet.h"
#include "doppel/train/overlay.h"
#include "doppel/train/stage_table.h"

namespace doppel {

namespace {

constexpr std::size_t kDeltaNetStatisticsFrames = 512;
/// Lower bound of the standard deviation of an input, metres.
constexpr double kDeltaNetFeatureFloor = 0.01;

}  // namespace

void describe_keys(const Keys& keys, DeltaNetRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  describe_keys(keys.section("data"), c.noise);
  keys("model.standardise", c.standardise,
       "scale the inputs by their mean and standard deviation over the training frames");
  describe_keys(keys.section("model"), c.model);
  keys("loss.chroma", c.chroma_weight, at_least(0.0), "weight, thesis A.2");
  keys("loss.silhouette", c.silhouette_weight, at_least(0.0), "weight, thesis A.2");
  keys("loss.laplacian", c.laplacian_weight, at_least(0.0), "weight, thesis A.2");
  describe_keys(keys.section("loss"), c.laplacian);
  keys("loss.anchor", c.anchor_weight, at_least(0.0),
       "weight of the mean squared distance from EGNet's surface, square metres: keeps vertices from sliding along it");
  keys("loss.smoothing", c.chroma.smoothing, at_least(0.0), "Gaussian on drawing and filmed image, pixels");
  describe_keys(keys.section("loss"), c.silhouette);
  keys("loss.lit", c.lit, "draw under the learnt lighting");
  keys("loss.target_gradient", c.target_gradient,
       "add the gradient of the filmed image to that of the drawing: convergence from farther away");
  describe_keys(keys.section("train"), c.trainer);
}

DeltaNetRunConfig DeltaNetRunConfig::read(const ConfigDocument& document) {
  DeltaNetRunConfig config = read_run<DeltaNetRunConfig>(document, "deltanet");
  config.loader.images = config.chroma_weight > 0.0;
  return config;
}

DeltaNetStage::DeltaNetStage(const Dataset& dataset, TrainedActor& actor, const DeltaNetRunConfig& config)
    : CaptureStage(dataset, actor.character,
                   with_past_frames(config.loader, std::max(actor.past_frames(), config.model.past_frames))),
      actor_(actor),
      config_(config),
      network_(actor.character, config.model,
               at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      laplacian_graph_(actor.character, config.laplacian),
      noise_(actor.character.skeleton, config.noise) {
  if (config.chroma_weight > 0.0) actor.require_texture("deltanet with loss.chroma > 0");
  if (config.chroma_weight > 0.0 && config.lit && !actor.lighting)
    fail<UsageError>(
        "deltanet: loss.lit is true and the stage `lighting` has not been trained; train it first, or set "
        "loss.lit to false");
  if (!config_.standardise) return;
  const auto [mean, std] =
      input_statistics(training_windows(kDeltaNetStatisticsFrames, config_.model.past_frames),
                       [this](const torch::Tensor& windows) { return network_->network_input(windows); });
  network_->set_input_statistics(mean, std, kDeltaNetFeatureFloor);
}

LossTerms DeltaNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  const torch::Tensor noisy = noise_.apply(batch.dofs, *network_, context.generator, context.share);
  torch::Tensor A, T, coarse, fine;
  {
    ProfileScope scope(profile, "egnet");
    torch::NoGradGuard no_grad;
    std::tie(A, T) = actor_.deformation(noisy, batch.dofs);
    coarse = actor_.surface->deformed(batch.dofs.select(1, -1).contiguous(), A, T);
  }
  torch::Tensor D;
  {
    ProfileScope scope(profile, "network");
    D = network_->forward(last_rows(noisy, config_.model.past_frames));
  }
  {
    ProfileScope scope(profile, "layers");
    fine = network_->displaced(actor_.surface, last_rows(batch.dofs, config_.model.past_frames), A, T, D);
  }
  LossTerms terms;
  if (config_.chroma_weight > 0.0) terms.push_back(chroma(batch, fine, profile));
  const SilhouetteLoss silhouette = batch_silhouette_loss(fine, actor_.mesh->faces, batch, config_.silhouette, profile);
  const auto views = [batch] { return silhouette_views(batch); };
  terms.push_back({"model_to_data", silhouette.model_to_data, config_.silhouette_weight, views});
  terms.push_back({"data_to_model", silhouette.data_to_model, config_.silhouette_weight, views});
  ProfileScope scope(profile, "laplacian");
  terms.push_back({"laplacian", laplacian_loss(fine, coarse, laplacian_graph_), config_.laplacian_weight});
  if (config_.anchor_weight > 0.0) terms.push_back({"anchor", anchor_loss(fine, coarse), config_.anchor_weight});
  return terms;
}

LossTerm DeltaNetStage::chroma(const Batch& batch, const torch::Tensor& vertices, Profile& profile) {
  ShadedImage drawn;
  torch::Tensor target;
  {
    ProfileScope scope(profile, "draw");
    const torch::Tensor lighting = config_.lit ? actor_.lighting->forward(batch.cameras).detach() : torch::Tensor();
    drawn = draw(*actor_.mesh, vertices, {actor_.static_texture, lighting}, batch.image_projection, batch.image.size(2),
                 batch.image.size(3));
    target = image_float(batch.image);
    if (config_.target_gradient)
      target = target_on_surface(vertices, batch.image_projection, *actor_.mesh, target, TargetOptions{}, &drawn);
  }
  ProfileScope scope(profile, "chroma");
  return {"chroma", chroma_loss(drawn.colour, drawn.mask, target, batch.image_mask, config_.chroma),
          config_.chroma_weight,
          [mask = drawn.mask, person = batch.image_mask] { return static_cast<double>(chroma_pixels(mask, person)); }};
}

std::pair<torch::Tensor, torch::Tensor> DeltaNetStage::surfaces(const torch::Tensor& dof_window) {
  const auto [A, T] = actor_.deformation(dof_window);
  const torch::Tensor window = last_rows(dof_window, config_.model.past_frames);
  const torch::Tensor D = network_->forward(window);
  return {actor_.surface->deformed(dof_window.select(1, -1).contiguous(), A, T),
          network_->displaced(actor_.surface, window, A, T, D)};
}

std::vector<ReportImage> DeltaNetStage::images() {
  std::vector<ReportImage> images;
  const int past_frames = loader_options().past_frames;
  for (const Split split : splits_to_show()) {
    const std::vector<SampleId> samples = samples_to_show(split, 4);
    if (samples.empty()) continue;
    OverlaySheet outlines(dataset(), actor_.mesh->faces);
    ImageSheet sheet(dataset(), loader_options().image_size);
    for (const SampleId& sample : samples) {
      const auto [coarse, fine] = surfaces(dataset().dof_window(sample, past_frames).unsqueeze(0));
      outlines.add(sample, coarse[0], fine[0]);
      if (!actor_.static_texture.defined()) continue;
      const Batch batch = sheet.batch(sample, past_frames);
      const Appearance look = actor_.lighting ? lit_appearance(actor_, batch.cameras) : static_appearance(actor_);
      const auto drawing = [&](const torch::Tensor& vertices) {
        return draw(*actor_.mesh, vertices, look, batch.image_projection, batch.image.size(2), batch.image.size(3));
      };
      sheet.add(batch, {drawing(coarse), drawing(fine)});
    }
    const std::string word = to_string(split);
    images.push_back({"overlay-" + word, word + " split: outline of the mask green, EGNet blue, with displacements red",
                      outlines.image()});
    if (sheet.empty()) continue;
    images.push_back({"colour-" + word,
                      word + " split: filmed image, EGNet with the static texture and its error, the same with "
                             "displacements",
                      sheet.image()});
  }
  return images;
}

namespace {

void evaluate_deltanet(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  rows["deltanet"] = evaluate_actor_surface(evaluation, "deltanet", &TrainedActor::fine);
  evaluate_static_texture(evaluation, rows);
}

}  // namespace

StageEntry delta_net_entry() {
  return actor_stage_entry<DeltaNetStage, DeltaNetRunConfig>("deltanet", {"ddc", "hybrid"}, {"egnet"},
                                                             evaluate_deltanet);
}

}  // namespace doppel
