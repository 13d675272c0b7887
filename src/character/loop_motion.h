#pragma once

#include "doppel/character/motion.h"
#include "doppel/character/root_motion.h"
#include "doppel/character/skeleton.h"

namespace doppel {

/// A motion that can be repeated without a jump. The last `blend` frames are taken away and blended into the first
/// ones, with weights that fall linearly. Angles are blended the short way. A person who ends elsewhere than he began
/// is moved back during these frames, so he slides.
/// @param blend frames, at least 1 and less than half of the motion
/// @throws UsageError for a motion that is too short
Motion loop_motion(const Motion& motion, const Skeleton& skeleton, int blend);

/// A motion of a person who travels, in a form that can be repeated: one more repetition starts where the last one
/// ended. The last `blend` frames are brought back by the step of a repetition before they are blended, so that nobody
/// slides. The frame after the last one is the first one after the step.
/// @param step of one repetition, `loop_step`
/// @throws UsageError for a motion that is too short
Motion travelling_loop(const Motion& motion, const Skeleton& skeleton, const Skeleton::Root& root, int blend,
                       const GroundStep& step);

/// The step of one repetition: from the first `blend` frames to the last ones.
/// @throws UsageError for a motion that is too short
GroundStep loop_step(const Motion& motion, const Skeleton::Root& root, int blend);

/// Whether a person travels rather than comes back: by more than 0.3 m or 45 degrees.
bool is_travel(const GroundStep& step);

}  // namespace doppel
