#pragma once

#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel {

/// The change of each DoF that turns its joint once around; 0 for DoFs that slide joints or drive several. [D]
std::vector<double> full_turns(const Skeleton& skeleton);

/// The DoFs at a time between two frames of a motion, linear in between. Angles take the short way. Where an angle
/// still jumps by more than a quarter turn, its joints have other angles for nearly the same pose, and the nearer frame
/// is the result.
/// @param turns full_turns of the skeleton @param frame 0 is the first frame; before the first and after the last frame
/// the motion stands still @return [D]
std::vector<double> dofs_at(const Motion& motion, const std::vector<double>& turns, double frame);

/// The motion at another frame rate, by dofs_at. The first instant stays. The ids of the result are 0, 1, 2, ...
/// @param step time between two frames of the result, in frames of `motion`: the rate of the motion by that of the
/// result; 1 gives the motion itself
/// @throws UsageError unless `step` is positive, and for more than a million frames
Motion resample(const Motion& motion, const Skeleton& skeleton, double step);

}  // namespace doppel
