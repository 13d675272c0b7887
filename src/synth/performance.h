#pragma once

#include <cstdint>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel::synth {

/// Generates a random motion for `make_skeleton()`: walking on the spot, squats, jumps, twists, turning, raised and
/// swinging arms, with smooth transitions. Each seed gives another motion. The lower foot stays on the floor except in
/// jumps.
/// @param frames number of rows, numbered from 0
/// @param turn mean speed of the turn about the vertical axis, radians per second
Motion make_motion(const Skeleton& skeleton, int frames, double fps, std::uint64_t seed, double turn = 0.0);

/// The height of the lower sole, metres: a soft minimum over the points of both soles.
double sole_height(const Skeleton& skeleton, const std::vector<double>& dofs);
/// Moves the root vertically so that the lower sole touches y = `height`.
void put_on_floor(const Skeleton& skeleton, std::vector<double>& dofs, double height = 0);

}  // namespace doppel::synth
