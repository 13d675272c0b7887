#pragma once

#include <vector>

#include "doppel/synth/actor.h"

namespace doppel::synth {

using Points = std::vector<Eigen::Vector3d>;

/// Parameters of the cloth simulation. A damped spring attaches each vertex to its skinned position; further springs
/// connect neighbouring vertices; inertia and air drag act on every vertex. Units are per unit of mass.
struct ClothingOptions {
  double stiffness = 55;  ///< 1/s², spring to the skinned position
  double damping = 4.5;   ///< 1/s, of the motion relative to the body
  double air = 4.0;       ///< 1/s, drag of the motion relative to the world
  double coupling = 700;  ///< 1/s², pull of the neighbours, for a mesh of 5,000 vertices (scaled for others)
  double inertia = 1.0;   ///< share of the body's acceleration that the cloth feels
  double reach = 0.13;    ///< metres, largest displacement of a free hem
  int substeps = 10;      ///< per frame
};

/// Simulates the clothes of the actor.
/// @param worn skinned positions of all vertices of the worn clothes, per frame, world metres
/// @return the true surface per frame. The simulation starts at rest: pass a lead-in of about a second and drop its
/// frames.
/// The result depends only on the arguments; a frame depends on all frames before it.
std::vector<Points> move_clothes(const Actor& actor, const std::vector<Points>& worn, double fps,
                                 const ClothingOptions& options = {});

}  // namespace doppel::synth
