#pragma once

#include <vector>

#include "doppel/synth/actor.h"

namespace doppel::synth {

using Points = std::vector<Eigen::Vector3d>;

/// How cloth follows the body: each vertex hangs on a damped spring from where skinning would put it, pulls at its
/// neighbours and is held back by its inertia and the air. Units per unit of mass.
struct ClothingOptions {
  double stiffness = 55;  ///< 1/s², spring to the skinned place
  double damping = 4.5;   ///< 1/s, of the motion relative to the body
  double air = 4.0;       ///< 1/s, drag of the motion relative to the room
  double coupling = 700;  ///< 1/s², pull of the neighbours, for a mesh of 5,000 vertices (scaled for others)
  double inertia = 1.0;   ///< share of the body's acceleration that the cloth feels
  double reach = 0.13;    ///< metres a free hem can leave its place at most
  int substeps = 10;      ///< per frame
};

/// Moves the clothes of the actor along.
/// @param worn where skinning alone would put every vertex of the worn clothes, per frame, world metres
/// @return the true surface per frame. Starts at rest: give it about a second of lead-in, and drop that.
/// A pure function of its arguments; a frame depends on all frames before it.
std::vector<Points> move_clothes(const Actor& actor, const std::vector<Points>& worn, double fps,
                                 const ClothingOptions& options = {});

}  // namespace doppel::synth
