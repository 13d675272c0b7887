#pragma once

#include <cstdint>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel::synth {

/// Generates a random motion for `make_skeleton()` of a person who moves about: walks, turns, reaches up, down and
/// sideways, squats, jumps, lunges and kicks, dances, twists, and stands. Each seed gives another motion. The lower
/// foot stays on the floor except in jumps, and it moves the person: the root travels by what the standing foot does
/// not slide.
/// @param frames number of rows, numbered from 0
/// @param room metres; the person walks to points at most this far from the centre and is brought back softly beyond
Motion make_varied_motion(const Skeleton& skeleton, int frames, double fps, std::uint64_t seed, double room);

}  // namespace doppel::synth
