#include "doppel/eval/actor_evaluation.h"

#include "doppel/actor/draw.h"
#include "doppel/eval/cloud_metrics.h"
#include "doppel/eval/flicker.h"
#include "doppel/eval/image_metrics.h"
#include "doppel/losses/chamfer.h"
#include "doppel/render/projection.h"

namespace doppel {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kFilmedSamples = 3;  // per side of a camera's pixel

std::string titled(const ActorEvaluation& evaluation, const std::string& title) {
  return title + ", " + to_string(evaluation.split);
}

/// Motion windows of samples, [B,F+1,D].
torch::Tensor dof_windows(const ActorEvaluation& evaluation, const std::vector<SampleId>& samples) {
  return evaluation.dataset.dof_windows(samples, evaluation.actor.past_frames());
}

/// The image of a radiance field in a frame. @param projection [3,4] pixels from world metres
FieldImage field_image(const ActorEvaluation& evaluation, Drawing drawing, const SampleId& sample,
                       const torch::Tensor& projection, int height, int width) {
  if (drawing == Drawing::nerf) return evaluation.actor.nerf->draw(projection, height, width);
  return evaluation.actor.radiance(dof_windows(evaluation, {sample}), projection, height, width);
}
/// The same in the crop of frame b of a request.
FieldImage field_image(const ActorEvaluation& evaluation, Drawing drawing, const ImageRequest& request, std::size_t b) {
  return field_image(evaluation, drawing, request.samples[b], request.projection[static_cast<std::int64_t>(b)][0],
                     request.size, request.size);
}

/// A pixel counts as covered if more than half of it is covered; its colour is that of the person alone.
WholeDrawing person_alone(const FieldImage& seen) {
  return {seen.colour / seen.opacity.clamp_min(0.5).unsqueeze(2), seen.opacity > 0.5};
}

RenderedImages field_images(const ActorEvaluation& evaluation, Drawing drawing, const ImageRequest& request) {
  std::vector<torch::Tensor> colour, covered;
  for (std::size_t b = 0; b < request.samples.size(); ++b) {
    const WholeDrawing person = person_alone(field_image(evaluation, drawing, request, b));
    colour.push_back(person.colour);
    covered.push_back(person.covered);
  }
  RenderedImages drawn{torch::stack(colour), torch::stack(covered)};
  drawn.whole = [&evaluation, drawing, request](std::size_t b) {
    const PinholeCamera& camera = evaluation.dataset.camera(request.camera);
    return person_alone(field_image(evaluation, drawing, request.samples[b], projection_tensor({camera})[0],
                                    camera.height, camera.width));
  };
  return drawn;
}

Appearance appearance(TrainedActor& actor, Drawing drawing, const torch::Tensor& dof_window,
                      const ImageRequest& request) {
  if (drawing == Drawing::lit) return lit_appearance(actor, torch::full({1, 1}, request.camera, torch::kInt64));
  if (drawing == Drawing::dynamic_texture)
    return dynamic_appearance(actor, dof_window, request.projection.select(1, 0));
  return static_appearance(actor);
}

/// The colours of frame b of a batch.
Appearance appearance_of_frame(const Appearance& look, std::int64_t b) {
  return {look.texture.size(0) == 1 ? look.texture : look.texture.narrow(0, b, 1), look.lighting};
}

RenderedImages surface_images(const ActorEvaluation& evaluation, Drawing drawing, const ImageRequest& request) {
  TrainedActor& actor = evaluation.actor;
  const torch::Tensor window = dof_windows(evaluation, request.samples);
  const Appearance look = appearance(actor, drawing, window, request);
  const torch::Tensor vertices = actor.fine(window);
  const ShadedImage drawn = draw(*actor.mesh, vertices, look, request.projection, request.size, request.size);
  const auto filmed = [mesh = actor.mesh, request, vertices, look](std::size_t b) {
    const auto i = static_cast<std::int64_t>(b);
    const SupersampledImage image =
        draw_filmed(*mesh, vertices.narrow(0, i, 1), appearance_of_frame(look, i), request.filmed_projection(b),
                    request.sides[b], request.sides[b], kFilmedSamples);
    return at::cat({image.image, image.alpha.unsqueeze(-1)}, -1)[0][0];
  };
  const auto whole = [mesh = actor.mesh, vertices, look,
                      camera = evaluation.dataset.camera(request.camera)](std::size_t b) {
    const auto i = static_cast<std::int64_t>(b);
    const ShadedImage image = draw(*mesh, vertices.narrow(0, i, 1), appearance_of_frame(look, i),
                                   projection_tensor({camera}).unsqueeze(0), camera.height, camera.width);
    return WholeDrawing{image.colour[0][0], image.mask[0][0]};
  };
  return RenderedImages{drawn.colour, drawn.mask, filmed, whole};
}

RenderedImages gaussian_images(const ActorEvaluation& evaluation, const ImageRequest& request) {
  TrainedActor& actor = evaluation.actor;
  const torch::Tensor window = dof_windows(evaluation, request.samples), vertices = actor.fine(window);
  const auto draw_frame = [&actor, window, vertices](std::size_t b, const torch::Tensor& projection, int height,
                                                     int width) {
    const auto i = static_cast<std::int64_t>(b);
    return draw_gaussians(actor, window.narrow(0, i, 1), projection, vertices.narrow(0, i, 1), height, width);
  };
  const SplatImage drawn =
      draw_gaussians(actor, window, request.projection.select(1, 0), vertices, request.size, request.size);
  RenderedImages images{drawn.colour, drawn.alpha > 0.5};
  images.alpha = drawn.alpha;
  images.filmed = [draw_frame, request](std::size_t b) {
    const SplatImage image = draw_frame(b, request.filmed_projection(b)[0], request.sides[b], request.sides[b]);
    return at::cat({image.colour, image.alpha.unsqueeze(-1)}, -1)[0][0];
  };
  images.whole = [draw_frame, camera = evaluation.dataset.camera(request.camera)](std::size_t b) {
    const SplatImage image = draw_frame(b, projection_tensor({camera}), camera.height, camera.width);
    return WholeDrawing{image.colour[0][0], image.alpha[0][0] > 0.5, image.alpha[0][0]};
  };
  return images;
}

/// The flicker of drawings along the surface that carries them.
/// @param field the drawings are of the radiance field around the refined surface
Json drawing_flicker(const ActorEvaluation& evaluation, const std::string& title, bool field,
                     const ImageFunction& render) {
  const auto surface = [&](const std::vector<SampleId>& samples) {
    const torch::Tensor window = dof_windows(evaluation, samples);
    return field ? evaluation.actor.refined(window) : evaluation.actor.fine(window);
  };
  return evaluate_flicker(evaluation.dataset, evaluation.split, evaluation.actor.mesh->faces, surface, render,
                          evaluation.options, titled(evaluation, title + ", flicker"))
      .to_json();
}

}  // namespace

Json evaluate_actor_surface(const ActorEvaluation& evaluation, const std::string& title,
                            torch::Tensor (TrainedActor::*surface)(const torch::Tensor&)) {
  const auto deformed = [&](const std::vector<SampleId>& samples) {
    return (evaluation.actor.*surface)(dof_windows(evaluation, samples));
  };
  return evaluate_surface(evaluation.dataset, evaluation.split, evaluation.actor.character, deformed,
                          evaluation.options, titled(evaluation, title))
      .to_json();
}

Json evaluate_actor_drawing(const ActorEvaluation& evaluation, const std::string& title, Drawing drawing) {
  const bool field = drawing == Drawing::radiance || drawing == Drawing::nerf;
  const auto render = [&](const ImageRequest& request) {
    if (drawing == Drawing::gaussians) return gaussian_images(evaluation, request);
    return field ? field_images(evaluation, drawing, request) : surface_images(evaluation, drawing, request);
  };
  Json row =
      evaluate_images(evaluation.dataset, evaluation.split, render, evaluation.options, titled(evaluation, title))
          .to_json();
  if (evaluation.options.flicker && drawing != Drawing::nerf &&
      has_flicker(evaluation.dataset, evaluation.split, evaluation.options))
    row.update(drawing_flicker(evaluation, title, field, render));
  return row;
}

Json evaluate_actor_cloud(const ActorEvaluation& evaluation) {
  const auto cloud = [&](const ImageRequest& request) {
    const FieldImage seen = field_image(evaluation, Drawing::radiance, request, 0);
    const torch::Tensor pixels = (seen.opacity > 0).nonzero().flip({1});
    const PixelRays rays = pixel_rays(request.projection[0][0], pixels);
    RenderedRays points;
    points.opacity = seen.opacity.masked_select(seen.opacity > 0);
    points.depth = seen.depth.masked_select(seen.opacity > 0);
    return point_cloud(points, rays.origin, rays.direction);
  };
  const auto result = evaluate_clouds(evaluation.dataset, evaluation.split, evaluation.actor.mesh->faces,
                                      evaluation.actor.character.num_vertices(), cloud, evaluation.options,
                                      titled(evaluation, "cloud"));
  return result ? result->to_json() : Json();
}

}  // namespace doppel
