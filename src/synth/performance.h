#pragma once

#include <cstdint>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel::synth {

/// Makes up a stretch of motion for `make_skeleton()`: walking in place, squats, jumps, side steps, turning, raised and
/// swinging arms, one melting into the other. Every seed gives another one. The lower foot stays on the floor except in
/// jumps.
/// @param frames how many rows, numbered from 0
Motion make_motion(const Skeleton& skeleton, int frames, double fps, std::uint64_t seed);

/// Lifts or lowers the root so that the lower sole touches y = `height`.
void put_on_floor(const Skeleton& skeleton, std::vector<double>& dofs, double height = 0);

}  // namespace doppel::synth
