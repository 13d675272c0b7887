#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "doppel/actor/trained_actor.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// An actor, and the frames it is compared on.
struct ActorEvaluation {
  const Dataset& dataset;
  TrainedActor& actor;
  Split split = Split::test;
  const EvaluationOptions& options;
};

/// How well a surface of the actor fills the masks. @param surface TrainedActor::coarse, fine or refined
nlohmann::ordered_json evaluate_actor_surface(const ActorEvaluation& evaluation, const std::string& title,
                                              torch::Tensor (TrainedActor::*surface)(const torch::Tensor&));

/// What the finished surface, or a radiance field, is coloured with.
enum class Drawing {
  static_texture,   ///< the template's texture, unlit
  lit,              ///< the same under the learnt light
  dynamic_texture,  ///< TexNet's texture
  radiance,         ///< the field around the mesh
  nerf,             ///< the field without a mesh
};

/// How near drawings come to the images. @pre the actor has what the drawing needs
nlohmann::ordered_json evaluate_actor_drawing(const ActorEvaluation& evaluation, const std::string& title,
                                              Drawing drawing);

/// How far the points of the radiance field lie off the true surface; null where no truth is known.
nlohmann::ordered_json evaluate_actor_cloud(const ActorEvaluation& evaluation);

}  // namespace doppel
