#include "doppel/character/loop_motion.h"

#include <cmath>
#include <numeric>

#include "doppel/character/resample_motion.h"
#include "doppel/core/error.h"

namespace doppel {

Motion loop_motion(const Motion& motion, const Skeleton& skeleton, int blend) {
  const int frames = motion.num_frames(), kept = frames - blend;
  if (blend < 1 || kept <= blend)
    fail<UsageError>("a loop blends {} frames, and this motion has {}; it needs more than {}", blend, frames,
                     2 * blend);
  const std::vector<double> turns = full_turns(skeleton);
  Motion loop;
  loop.frames.assign(motion.frames.begin(), motion.frames.begin() + kept);
  loop.ids.resize(kept);
  std::iota(loop.ids.begin(), loop.ids.end(), 0L);
  for (int t = 0; t < blend; ++t) {
    const double share = static_cast<double>(t) / blend;
    for (std::size_t d = 0; d < turns.size(); ++d) {
      const double late = motion.frames[kept + t][d];
      double change = motion.frames[t][d] - late;
      if (turns[d] > 0.0) change = std::remainder(change, turns[d]);
      loop.frames[t][d] = late + share * change;
    }
  }
  return loop;
}

}  // namespace doppel
