#pragma once

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel {

/// A motion that can be repeated without a jump. The last `blend` frames are taken away and blended into the first
/// ones, with weights that fall linearly. Angles are blended the short way. A person who ends elsewhere than he began
/// is moved back during these frames.
/// @param blend frames, at least 1 and less than half of the motion
/// @throws UsageError for a motion that is too short
Motion loop_motion(const Motion& motion, const Skeleton& skeleton, int blend);

}  // namespace doppel
