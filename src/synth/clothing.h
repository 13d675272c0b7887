#pragma once

#include <vector>

#include "doppel/synth/actor.h"

namespace doppel::synth {

using Points = std::vector<Eigen::Vector3d>;

/// Simulates the clothes of the actor. A damped spring attaches each vertex to its skinned position; further springs
/// connect neighbouring vertices; inertia and air drag act on every vertex.
/// @param worn skinned positions of all vertices of the worn clothes, per frame, world metres
/// @return the true surface per frame. The simulation starts at rest: pass a lead-in of about a second and drop its
/// frames.
/// The result depends only on the arguments; a frame depends on all frames before it.
std::vector<Points> move_clothes(const Actor& actor, const std::vector<Points>& worn, double fps);

}  // namespace doppel::synth
