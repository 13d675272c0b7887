#include "doppel/character/loop_motion.h"

#include <cmath>
#include <numeric>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kTurn = 2.0 * 3.14159265358979323846;

/// The change of each DoF that turns its joints once around; 0 for DoFs that slide joints. [D]
std::vector<double> full_turns(const Skeleton& skeleton) {
  std::vector<double> turns;
  for (const Dof& dof : skeleton.dofs) {
    double turn = 0.0;
    for (const Dof::Drive& drive : dof.joints)
      if (skeleton.joints[drive.joint].type == Joint::Type::revolute && drive.weight != 0.0)
        turn = dof.joints.size() == 1 ? kTurn / std::abs(drive.weight) : 0.0;
    turns.push_back(turn);
  }
  return turns;
}

}  // namespace

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
