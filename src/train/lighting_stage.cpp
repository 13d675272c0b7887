#include "doppel/train/lighting_stage.h"

#include "doppel/actor/draw.h"
#include "doppel/losses/images.h"
#include "doppel/train/image_sheet.h"
#include "doppel/train/stage_table.h"

namespace doppel {

void describe_keys(const Keys& keys, LightingRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  keys("loss.lighting", c.weight, at_least(0.0), "weight");
  keys("loss.deviation", c.deviation_weight, at_least(0.0),
       "weight that pulls cameras to their mean. A camera observes no light from behind the surfaces that it sees, and "
       "a camera that was not trained on gets the mean");
  describe_keys(keys.section("train"), c.trainer);
}

LightingRunConfig LightingRunConfig::read(const ConfigDocument& document) {
  return read_run<LightingRunConfig>(document, "lighting");
}

LightingStage::LightingStage(const Dataset& dataset, TrainedActor& actor, const LightingRunConfig& config)
    : CaptureStage(dataset, actor.character, with_past_frames(config.loader, actor.past_frames())),
      actor_(actor),
      config_(config),
      lighting_(static_cast<std::int64_t>(dataset.cameras().size()), dataset.camera_indices(config.loader.cameras)) {
  actor.require_texture("lighting");
}

LossTerms LightingStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  torch::Tensor vertices;
  {
    ProfileScope scope(profile, "surface");
    vertices = actor_.coarse(batch.dofs);
  }
  ShadedImage drawn;
  {
    ProfileScope scope(profile, "draw");
    drawn = draw(*actor_.mesh, vertices, {actor_.static_texture, lighting_->forward(batch.cameras)},
                 batch.image_projection, batch.image.size(2), batch.image.size(3));
  }
  ProfileScope scope(profile, "compare");
  LossTerms terms{{"lighting",
                   lighting_loss(drawn.colour, drawn.mask, image_float(batch.image), batch.image_mask, config_.loss),
                   config_.weight, [this, batch, mask = drawn.mask] {
                     return static_cast<double>(lighting_pixels(mask, batch.image_mask, config_.loss));
                   }}};
  if (config_.deviation_weight > 0.0)
    terms.push_back({"deviation", lighting_->deviation(), config_.deviation_weight, same_on_all_ranks});
  return terms;
}

std::vector<ReportImage> LightingStage::images() {
  ImageSheet sheet(dataset(), loader_options().image_size);
  for (const SampleId& sample : samples_to_show(loader_options().split, 3)) {
    const Batch batch = sheet.batch(sample, actor_.past_frames());
    const torch::Tensor vertices = actor_.coarse(batch.dofs);
    const auto drawing = [&](const torch::Tensor& lighting) {
      return draw(*actor_.mesh, vertices, {actor_.static_texture, lighting}, batch.image_projection,
                  batch.image.size(2), batch.image.size(3));
    };
    sheet.add(batch, {drawing({}), drawing(lighting_->forward(batch.cameras))});
  }
  return {{"lighting",
           "rows of three: filmed image, static texture and its error, static texture with the trained lighting and "
           "its error",
           sheet.image()}};
}

namespace {

void evaluate_lighting(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  evaluate_static_texture(evaluation, rows);
  rows["lit"] = evaluate_actor_drawing(evaluation, "lit", Drawing::lit);
}

}  // namespace

StageEntry lighting_entry() {
  return actor_stage_entry<LightingStage, LightingRunConfig>("lighting", {"ddc", "hybrid"}, {"egnet"},
                                                             evaluate_lighting);
}

}  // namespace doppel
