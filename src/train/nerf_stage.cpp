#include "doppel/train/nerf_stage.h"

#include <algorithm>

#include "doppel/losses/images.h"
#include "doppel/losses/radiance.h"
#include "doppel/train/stage_table.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Random pixels (column, row) of an image. With an empty mask all are anywhere. @param in_mask share in the mask, 0..1
Tensor random_pixels(const Tensor& mask, std::int64_t count, double in_mask, at::Generator& generator) {
  const std::int64_t width = mask.size(1);
  Tensor inside = mask.flatten().nonzero().squeeze(1);
  if (inside.size(0) == 0) inside = torch::arange(mask.numel(), torch::kInt64);
  const auto shown = static_cast<std::int64_t>(in_mask * static_cast<double>(count));
  const Tensor first = inside.index_select(0, torch::randint(0, inside.size(0), {shown}, generator, torch::kInt64));
  const Tensor positions =
      torch::cat({first, torch::randint(0, mask.numel(), {count - shown}, generator, torch::kInt64)});
  return torch::stack({positions.remainder(width), torch::div(positions, width, "floor")}, 1);
}

}  // namespace

void describe_keys(const Keys& keys, NerfRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  keys.require("data.batch_size", c.loader.batch_size == 1,
               fmt::format("found {}; the field represents one frame, so only 1 is allowed", c.loader.batch_size));
  keys("rays.count", c.rays, between(1, 1 << 20), "of a step");
  keys("rays.in_mask", c.in_mask, between(0.0, 1.0),
       "share of them drawn inside the mask; the others from the whole image");
  describe_keys(keys.section("model"), c.model);
  describe_keys(keys.section("train"), c.trainer);
}

NerfRunConfig NerfRunConfig::read(const ConfigDocument& document) { return read_run<NerfRunConfig>(document, "nerf"); }

NerfStage::NerfStage(const Dataset& dataset, TrainedActor& actor, const NerfRunConfig& config)
    : CaptureStage(dataset, actor.character, with_past_frames(config.loader, actor.past_frames())), config_(config) {
  const Tensor window =
      dataset.dof_window(nerf_frame(dataset, config.loader.split, config.loader.frames), actor.past_frames())
          .unsqueeze(0);
  model_ = PlainField(actor.fine(window)[0], config.model,
                      at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed)));
}

LossTerms NerfStage::loss(const Batch& batch, StepContext& context) {
  const std::int64_t C = batch.image.size(1), share = std::max<std::int64_t>(1, config_.rays / C);
  std::vector<Tensor> origin, direction, colour, mask;
  for (std::int64_t c = 0; c < C; ++c) {
    const Tensor foreground = batch.image_mask[0][c];
    const Tensor pixels = random_pixels(foreground, share, config_.in_mask, context.generator);
    const PixelRays rays = pixel_rays(batch.image_projection[0][c], pixels);
    origin.push_back(rays.origin.expand({pixels.size(0), 3}));
    direction.push_back(rays.direction);
    colour.push_back(image_float(at_pixels(batch.image[0][c], pixels)));
    mask.push_back(at_pixels(foreground, pixels).to(torch::kFloat32));
  }
  // Every rank draws all rays, and renders its share of them.
  const Tensor all = torch::cat(direction);
  context.share = share_of_rays(context.ranks, all.size(0));
  const auto rows = [&](const std::vector<Tensor>& parts) { return context.share.rows(torch::cat(parts)); };
  const Tensor colours = rows(colour), masks = rows(mask);
  PlainRays seen;
  {
    ProfileScope scope(*context.profile, "field");
    seen = model_->render(rows(origin), context.share.rows(all), context.generator, context.share);
  }
  const auto compare = [&](const RenderedRays& rays, const RaySamples& samples) {
    return radiance_loss(rays, samples, colours, masks);
  };
  const RadianceLoss coarse = compare(seen.coarse, seen.coarse_samples), fine = compare(seen.fine, seen.fine_samples);
  return {{"colour", fine.colour, 1.0},
          {"mask", fine.mask, 1.0},
          {"coarse_colour", coarse.colour, 1.0},
          {"coarse_mask", coarse.mask, 1.0}};
}

namespace {

void evaluate_nerf(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  // A radiance field without a mesh represents a single frame.
  const std::vector<SampleId> samples = evaluated_samples(evaluation.dataset, evaluation.split, evaluation.options);
  if (samples != std::vector<SampleId>{*evaluation.actor.nerf_frame}) return;
  rows["nerf"] = evaluate_actor_drawing(evaluation, "nerf", Drawing::nerf);
}

}  // namespace

StageEntry nerf_entry() {
  return actor_stage_entry<NerfStage, NerfRunConfig>("nerf", {"hybrid"}, {"egnet"}, evaluate_nerf);
}

}  // namespace doppel
