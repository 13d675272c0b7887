#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "doppel/character/character.h"

namespace doppel::synth {

struct ActorOptions {
  int vertices = 5000;
  int nodes = 500;
  int texture_size = 1024;
  double grid_cell = 0.016;  ///< metres; must resolve the hands
};

/// The synthetic actor: an ordinary character, and data that is known only because the actor is synthetic.
struct Actor {
  Character character;
  std::vector<double> openness;       ///< [N] unoccluded share of a vertex's surroundings in the rest pose, for shading
  std::vector<double> looseness;      ///< [N] 0 skin-tight .. 1 free hem
  std::vector<Eigen::Vector3d> hang;  ///< [N] offset of the worn clothes from the template, metres in the rest pose
  std::vector<Eigen::Vector3d> own_rest;  ///< [N] vertices of the actor's own body at rest, also of another body
  /// Of another body: where each part of the actor's own body (body_field.h) goes, in the rest pose. Empty: it is her
  /// own. Head, hair and skirt are not used, and are the identity.
  std::vector<Eigen::Affine3d> part_warps;
};

/// Builds the actor: a woman of 1.75 m in a pullover and a wide skirt, 33 DoFs (6 root, 27 joints, the trunk rigid), 21
/// landmarks. The same options give the same actor, bit for bit.
/// @throws Error when the counts cannot be reached
Actor make_actor(const ActorOptions& options);

/// The parts of `make_actor` that have their own tests.
Skeleton make_skeleton();
SkinningWeights make_weights(const TriangleMesh& mesh);

}  // namespace doppel::synth
