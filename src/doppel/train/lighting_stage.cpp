#include "doppel/train/lighting_stage.h"

#include "doppel/losses/images.h"
#include "doppel/render/shading/shading.h"
#include "doppel/train/picture_sheet.h"

namespace doppel {

LightingRunConfig LightingRunConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  LightingRunConfig c;
  c.subject = RunSubject::read(document, root, "lighting");
  const ConfigReader data = root.section("data");
  c.loader = read_picture_loader_options(data, 4, 0, c.subject.seed);
  const ConfigReader loss = root.section("loss");
  c.weight = loss.get("lighting", c.weight, at_least(0.0));
  c.deviation_weight = loss.get("deviation", c.deviation_weight, at_least(0.0));
  c.loss.erosion = loss.get("erosion", c.loss.erosion, between(0, 100));
  c.trainer = TrainerOptions::read(root.section("train"), c.subject.seed);
  root.finish();
  return c;
}

LightingStage::LightingStage(const Dataset& dataset, TrainedActor& actor, const LightingRunConfig& config)
    : CaptureStage(dataset, actor.character, with_window(config.loader, actor.window())),
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
    drawn = shade(vertices, actor_.static_texture, lighting_->forward(batch.cameras), batch.image_projection,
                  *actor_.mesh, batch.image.size(2), batch.image.size(3));
  }
  ProfileScope scope(profile, "compare");
  LossTerms terms{{"lighting",
                   lighting_loss(drawn.colour, drawn.mask, image_float(batch.image), batch.image_mask, config_.loss),
                   config_.weight}};
  if (config_.deviation_weight > 0.0) terms.push_back({"deviation", lighting_->deviation(), config_.deviation_weight});
  return terms;
}

std::vector<Picture> LightingStage::pictures() {
  PictureSheet sheet(dataset(), loader_options().image_size);
  for (const SampleId& sample : samples_to_show(loader_options().split, 3)) {
    const Batch batch = sheet.batch(sample, actor_.window());
    const torch::Tensor vertices = actor_.coarse(batch.dofs);
    const auto draw = [&](const torch::Tensor& lighting) {
      return shade(vertices, actor_.static_texture, lighting, batch.image_projection, *actor_.mesh, batch.image.size(2),
                   batch.image.size(3), {lighting.defined()});
    };
    sheet.add(batch, {draw({}), draw(lighting_->forward(batch.cameras))});
  }
  return {{"lighting",
           "rows of three: photograph, static texture with the error beside it, static texture under the learnt light "
           "with the error beside it",
           sheet.image()}};
}

}  // namespace doppel
