#include "doppel/character/loop_motion.h"

#include <cmath>
#include <numeric>

#include "doppel/character/resample_motion.h"
#include "doppel/core/angles.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kTravelMetres = 0.3, kTravelRadians = 45.0 * kRadiansPerDegree;

/// The frames that stay of a motion. @throws UsageError when it is too short
int frames_kept(const Motion& motion, int blend) {
  const int frames = motion.num_frames(), kept = frames - blend;
  if (blend < 1 || kept <= blend)
    fail<UsageError>("a loop blends {} frames, and this motion has {}; it needs more than {}", blend, frames,
                     2 * blend);
  return kept;
}

/// @param late `late(t)`: what frame t of the repetition is at first, as the motion goes on
template <typename Late>
Motion blended_loop(const Motion& motion, const Skeleton& skeleton, int blend, const Late& late) {
  const int kept = frames_kept(motion, blend);
  const std::vector<double> turns = full_turns(skeleton);
  Motion loop;
  loop.frames.assign(motion.frames.begin(), motion.frames.begin() + kept);
  loop.ids.resize(kept);
  std::iota(loop.ids.begin(), loop.ids.end(), 0L);
  for (int t = 0; t < blend; ++t) {
    const double share = static_cast<double>(t) / blend;
    const std::vector<double> from = late(t);
    for (std::size_t d = 0; d < turns.size(); ++d) {
      double change = motion.frames[t][d] - from[d];
      if (turns[d] > 0.0) change = std::remainder(change, turns[d]);
      loop.frames[t][d] = from[d] + share * change;
    }
  }
  return loop;
}

}  // namespace

Motion loop_motion(const Motion& motion, const Skeleton& skeleton, int blend) {
  return blended_loop(motion, skeleton, blend, [&](int t) { return motion.frames[frames_kept(motion, blend) + t]; });
}

Motion travelling_loop(const Motion& motion, const Skeleton& skeleton, const Skeleton::Root& root, int blend,
                       const GroundStep& step) {
  return blended_loop(motion, skeleton, blend, [&](int t) {
    return before_step(root, motion.frames[frames_kept(motion, blend) + t], step, motion.frames[t]);
  });
}

GroundStep loop_step(const Motion& motion, const Skeleton::Root& root, int blend) {
  return ground_step(root, motion, 0, frames_kept(motion, blend), blend);
}

bool is_travel(const GroundStep& step) {
  return step.way().norm() > kTravelMetres || std::abs(step.turn) > kTravelRadians;
}

}  // namespace doppel
