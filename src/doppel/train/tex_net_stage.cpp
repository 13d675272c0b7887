#include "doppel/train/tex_net_stage.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/losses/images.h"
#include "doppel/render/shading/shading.h"
#include "doppel/train/picture_sheet.h"

namespace doppel {

TexNetRunConfig TexNetRunConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  TexNetRunConfig c;
  c.subject = RunSubject::read(document, root, "texnet");
  const ConfigReader data = root.section("data");
  c.loader = read_picture_loader_options(data, 12, 1, c.subject.seed);
  if (c.loader.cameras_per_sample != 1)
    data.fail_at_key("cameras_per_sample", "found {}; a texture is for one camera, so only 1 is allowed",
                     c.loader.cameras_per_sample);
  c.noise = PoseNoiseOptions::read(data);
  c.model = TexNetConfig::read(root.section("model"));
  const ConfigReader loss = root.section("loss");
  c.weight = loss.get("photometric", c.weight, at_least(0.0));
  c.loss.erosion = loss.get("erosion", c.loss.erosion, between(0, 100));
  c.loss.squares = loss.choice("distance", {"absolute", "squares"}, "absolute") == "squares";
  c.nearest = loss.get("nearest", c.nearest);
  c.trainer = TrainerOptions::read(root.section("train"), c.subject.seed);
  root.finish();
  return c;
}

TexNetStage::TexNetStage(const Dataset& dataset, TrainedActor& actor, const TexNetRunConfig& config)
    : CaptureStage(dataset, actor.character, with_window(config.loader, std::max(actor.window(), config.model.window))),
      actor_(actor),
      config_(config),
      network_(make_tex_net(actor, config.model,
                            at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed)))),
      texture_space_(*actor.mesh, config.model.size),
      noise_(actor.character.skeleton, config.noise) {}

LossTerms TexNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  torch::Tensor vertices, input, texture;
  {
    ProfileScope scope(profile, "geometry");
    vertices = actor_.fine(batch.dofs);
  }
  {
    ProfileScope scope(profile, "input");
    torch::NoGradGuard no_grad;
    input = texture_input(actor_, texture_space_, config_.model, noise_.apply(batch.dofs, context.generator),
                          batch.image_projection.select(1, 0), vertices);
  }
  {
    ProfileScope scope(profile, "network");
    texture = network_->forward(input, context.generator);
  }
  ShadedImage drawn;
  {
    ProfileScope scope(profile, "draw");
    ShadingOptions options;
    options.lit = false;
    options.nearest = config_.nearest;
    drawn = shade(vertices, texture, {}, batch.image_projection, *actor_.mesh, batch.image.size(2), batch.image.size(3),
                  options);
  }
  ProfileScope scope(profile, "compare");
  return {{"photometric",
           photometric_loss(drawn.colour, drawn.mask, image_float(batch.image), batch.image_mask, config_.loss),
           config_.weight}};
}

std::vector<Picture> TexNetStage::pictures() {
  std::vector<Picture> pictures;
  const int window = loader_options().window;
  for (Split split : {Split::test, Split::train}) {
    const std::vector<SampleId> samples = samples_to_show(split, 4);
    if (samples.empty()) continue;
    PictureSheet sheet(dataset(), loader_options().image_size);
    for (const SampleId& sample : samples) {
      const Batch batch = sheet.batch(sample, window);
      const auto views = batch.cameras.size(1);
      const torch::Tensor windows = batch.dofs.expand({views, -1, -1}).contiguous();
      const torch::Tensor vertices = actor_.fine(batch.dofs);
      const torch::Tensor input = texture_input(actor_, texture_space_, config_.model, windows,
                                                batch.image_projection[0], vertices.expand({views, -1, -1}));
      const torch::Tensor texture = network_->forward(input);
      const auto draw = [&](const torch::Tensor& with) {
        return shade(vertices, with, {}, batch.image_projection, *actor_.mesh, batch.image.size(2), batch.image.size(3),
                     {false});
      };
      std::vector<ShadedImage> drawings;
      if (actor_.static_texture.defined()) drawings.push_back(draw(actor_.static_texture));
      drawings.push_back(draw(texture));
      sheet.add(batch, drawings);
    }
    const std::string word = to_string(split);
    pictures.push_back({"texture-" + word,
                        word + " split: photograph, static texture and its error, dynamic texture and its error",
                        sheet.image()});
  }
  return pictures;
}

}  // namespace doppel
