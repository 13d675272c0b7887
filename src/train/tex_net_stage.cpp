#include "doppel/train/tex_net_stage.h"

#include <algorithm>

#include "doppel/actor/draw.h"
#include "doppel/losses/images.h"
#include "doppel/train/stage_table.h"

namespace doppel {

void describe_keys(const Keys& keys, TexNetRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  keys.require("data.cameras_per_sample", c.loader.cameras_per_sample == 1,
               fmt::format("found {}; a texture is for one camera, so only 1 is allowed", c.loader.cameras_per_sample));
  describe_keys(keys.section("data"), c.noise);
  describe_keys(keys.section("model"), c.model);
  keys("loss.photometric", c.weight, at_least(0.0), "weight");
  keys("loss.distance", c.loss.squares, {"absolute", "squares"}, "of colours, as in the thesis, or half the squares");
  keys("loss.nearest", c.nearest, "draw with the nearest texel");
  describe_keys(keys.section("train"), c.trainer);
}

TexNetRunConfig TexNetRunConfig::read(const ConfigDocument& document) {
  return read_run<TexNetRunConfig>(document, "texnet");
}

TexNetStage::TexNetStage(const Dataset& dataset, TrainedActor& actor, const TexNetRunConfig& config)
    : CaptureStage(dataset, actor.character,
                   with_past_frames(config.loader, std::max(actor.past_frames(), config.model.past_frames))),
      actor_(actor),
      config_(config),
      network_(make_tex_net(actor, config.model,
                            at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed)))),
      texture_space_(*actor.mesh, config.model.size),
      noise_(actor.character.skeleton, config.noise) {}

LossTerms TexNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  torch::Tensor vertices, texture;
  TexNetInput input;
  {
    ProfileScope scope(profile, "geometry");
    vertices = actor_.fine(batch.dofs);
  }
  {
    ProfileScope scope(profile, "input");
    torch::NoGradGuard no_grad;
    input = texture_input(actor_, texture_space_, config_.model,
                          noise_.apply(batch.dofs, *network_, context.generator, context.share),
                          batch.image_projection.select(1, 0), vertices);
  }
  {
    ProfileScope scope(profile, "network");
    texture = network_->forward(input, context.generator, context.share);
  }
  ShadedImage drawn;
  {
    ProfileScope scope(profile, "draw");
    drawn = draw(*actor_.mesh, vertices, {texture, {}}, batch.image_projection, batch.image.size(2),
                 batch.image.size(3), config_.nearest);
  }
  ProfileScope scope(profile, "compare");
  return {{"photometric",
           photometric_loss(drawn.colour, drawn.mask, image_float(batch.image), batch.image_mask, config_.loss),
           config_.weight, [this, batch, mask = drawn.mask] {
             return static_cast<double>(photometric_pixels(mask, batch.image_mask, config_.loss));
           }}};
}

std::vector<ReportImage> TexNetStage::images() {
  const auto drawings_of = [&](const Batch& batch) {
    const auto views = batch.cameras.size(1);
    const torch::Tensor windows = batch.dofs.expand({views, -1, -1}).contiguous();
    const torch::Tensor vertices = actor_.fine(batch.dofs);
    const TexNetInput input = texture_input(actor_, texture_space_, config_.model, windows, batch.image_projection[0],
                                            vertices.expand({views, -1, -1}));
    const torch::Tensor texture = network_->forward(input);
    const auto drawing = [&](const torch::Tensor& with) {
      return draw(*actor_.mesh, vertices, {with, {}}, batch.image_projection, batch.image.size(2), batch.image.size(3));
    };
    std::vector<ShadedImage> drawings;
    if (actor_.static_texture.defined()) drawings.push_back(drawing(actor_.static_texture));
    drawings.push_back(drawing(texture));
    return drawings;
  };
  return drawn_images("texture", "filmed image, static texture and its error, dynamic texture and its error",
                      drawings_of);
}

namespace {

void evaluate_texnet(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  evaluate_static_texture(evaluation, rows);
  rows["texnet"] = evaluate_actor_drawing(evaluation, "texnet", Drawing::dynamic_texture);
}

}  // namespace

StageEntry tex_net_entry() {
  return actor_stage_entry<TexNetStage, TexNetRunConfig>("texnet", {"ddc", "hybrid"}, {"egnet"}, evaluate_texnet);
}

}  // namespace doppel
