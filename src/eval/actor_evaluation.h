#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "doppel/actor/trained_actor.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// An actor and the frames of its evaluation.
struct ActorEvaluation {
  const Dataset& dataset;
  TrainedActor& actor;
  Split split = Split::test;
  const EvaluationOptions& options;
};

/// How well the silhouette of an actor's surface matches the masks. @param surface TrainedActor::coarse, fine or
/// refined
nlohmann::ordered_json evaluate_actor_surface(const ActorEvaluation& evaluation, const std::string& title,
                                              torch::Tensor (TrainedActor::*surface)(const torch::Tensor&));

/// The kinds of drawings of an actor: colours of the finished surface, or a radiance field.
enum class Drawing {
  static_texture,   ///< the static texture, unlit
  lit,              ///< the same under the learnt lighting
  dynamic_texture,  ///< TexNet's texture
  gaussians,        ///< the Gaussians on the surface
  radiance,         ///< the field around the mesh
  nerf,             ///< the field without a mesh
};

/// How well drawings match the images. @pre the actor has the networks and textures of the drawing
nlohmann::ordered_json evaluate_actor_drawing(const ActorEvaluation& evaluation, const std::string& title,
                                              Drawing drawing);

/// The distance of the radiance field's points from the true surface; null without ground truth.
nlohmann::ordered_json evaluate_actor_cloud(const ActorEvaluation& evaluation);

}  // namespace doppel
