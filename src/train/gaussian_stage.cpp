#include "doppel/train/gaussian_stage.h"

#include <algorithm>

#include "doppel/actor/draw.h"
#include "doppel/losses/images.h"
#include "doppel/losses/person_images.h"
#include "doppel/losses/similarity.h"
#include "doppel/train/stage_table.h"

namespace doppel {

using torch::Tensor;

void describe_keys(const Keys& keys, GaussiansRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  describe_keys(keys.section("model"), c.model);
  keys.require("data.cameras_per_sample", c.loader.cameras_per_sample == 1 || !c.model.network || !c.model.camera,
               fmt::format("found {}; a network that sees the camera draws for one camera, so only 1 is allowed",
                           c.loader.cameras_per_sample));
  keys("loss.photometric", c.photometric, at_least(0.0),
       "weight of the colours' differences, levels of 255, per pixel of the mask");
  keys("loss.similarity", c.similarity, at_least(0.0), "weight of 1 - SSIM");
  keys("loss.silhouette", c.silhouette, at_least(0.0), "weight of the difference of alpha and mask");
  keys("loss.offset", c.offset, at_least(0.0), "weight of the offsets' length, in texels");
  keys("loss.scale", c.scale, at_least(0.0), "weight of standard deviations beyond `largest_scale`, in texels");
  keys("loss.studio", c.studio, "compare over the empty studio, where the capture has it, and not over black");
  keys("loss.largest_scale", c.largest_scale, at_least(0.1), "texels");
  describe_keys(keys.section("train"), c.trainer);
}

GaussiansRunConfig GaussiansRunConfig::read(const ConfigDocument& document) {
  return read_run<GaussiansRunConfig>(document, "gaussians");
}

GaussianStage::GaussianStage(const Dataset& dataset, TrainedActor& actor, const GaussiansRunConfig& config)
    : CaptureStage(dataset, actor.character,
                   with_past_frames(config.loader, std::max(actor.past_frames(), config.model.past_frames))),
      actor_(actor),
      config_(config),
      space_(*actor.mesh, config.model.size),
      gaussians_(make_gaussians(actor, space_, config.model,
                                at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed)))),
      studio_(dataset) {
  if (!config.studio || !studio_.exist()) return;
  try {
    studio_.check(dataset.camera_indices(config.loader.cameras));
  } catch (const Error& error) {
    fail("{}. Gaussians are compared over the empty studio; add the image, or set gaussians.loss.studio: false",
         error.what());
  }
}

LossTerms GaussianStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  Tensor vertices;
  {
    ProfileScope scope(profile, "geometry");
    vertices = actor_.fine(batch.dofs);
  }
  Splats splats;
  {
    ProfileScope scope(profile, "network");
    splats = posed_splats(actor_, gaussians_, space_, batch.dofs, batch.image_projection.select(1, 0), vertices,
                          context.generator, context.share);
  }
  SplatImage drawn;
  {
    ProfileScope scope(profile, "draw");
    drawn = draw_splats(splats, batch.image_projection, batch.image.size(2), batch.image.size(3));
  }
  ProfileScope scope(profile, "compare");
  const Tensor mask = batch.image_mask.to(torch::kFloat32), pixels = mask.sum().clamp_min(1.0);
  const Tensor image = image_float(batch.image);
  const PersonImages compared = config_.studio && studio_.exist()
                                    ? person_over_studio(drawn.colour, drawn.alpha, image, mask, studio_.of(batch))
                                    : person_over_black(drawn.colour, image, mask);
  const auto count = [mask] { return std::max(mask.sum().item<double>(), 1.0); };
  return {{"photometric", 255.0 / 3.0 * (compared.drawn - compared.filmed).abs().sum() / pixels, config_.photometric,
           count},
          {"similarity", similarity_loss(compared.drawn, compared.filmed), config_.similarity},
          {"silhouette", ((drawn.alpha - mask).abs() * compared.certain).sum() / pixels, config_.silhouette, count},
          {"offset", gaussians_->offset_length(), config_.offset, same_on_all_ranks},
          {"scale", gaussians_->excess_scale(config_.largest_scale), config_.scale, same_on_all_ranks}};
}

namespace {

/// The look of the mesh that the Gaussians are compared with: TexNet's texture, else the static one, under light if
/// this was learnt. @param batch B = C = 1
Appearance mesh_appearance(TrainedActor& actor, const Batch& batch) {
  if (actor.texnet) return dynamic_appearance(actor, batch.dofs, batch.image_projection[0]);
  return actor.lighting ? lit_appearance(actor, batch.cameras) : static_appearance(actor);
}

}  // namespace

std::vector<ReportImage> GaussianStage::images() {
  const auto drawings_of = [&](const Batch& batch) -> std::vector<ShadedImage> {
    const auto height = batch.image.size(2), width = batch.image.size(3);
    const Tensor vertices = actor_.fine(batch.dofs);
    const ShadedImage mesh =
        draw(*actor_.mesh, vertices, mesh_appearance(actor_, batch), batch.image_projection, height, width);
    const SplatImage drawn =
        draw_splats(posed_splats(actor_, gaussians_, space_, batch.dofs, batch.image_projection[0], vertices),
                    batch.image_projection, height, width);
    return {mesh, {drawn.colour, drawn.alpha > 0.5, {}}};
  };
  return drawn_images("gaussians", "filmed image, textured mesh and its error, drawn Gaussians and their error",
                      drawings_of);
}

namespace {

void evaluate_gaussians(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  evaluate_static_texture(evaluation, rows);
  rows["gaussians"] = evaluate_actor_drawing(evaluation, "gaussians", Drawing::gaussians);
}

}  // namespace

StageEntry gaussians_entry() {
  return actor_stage_entry<GaussianStage, GaussiansRunConfig>("gaussians", {"ddc", "hybrid"}, {"egnet"},
                                                              evaluate_gaussians);
}

}  // namespace doppel
