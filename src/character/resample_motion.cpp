#include "doppel/character/resample_motion.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kTurn = 2.0 * 3.14159265358979323846;
/// Times this near to a frame are the frame itself, so that rates which divide each other give its exact numbers.
constexpr double kSameTime = 1e-6;
constexpr double kMaxResampled = 1e6;

}  // namespace

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

std::vector<double> dofs_at(const Motion& motion, const std::vector<double>& turns, double frame) {
  const double at = std::clamp(frame, 0.0, static_cast<double>(motion.num_frames() - 1)), nearest = std::round(at);
  if (std::abs(at - nearest) < kSameTime) return motion.frames[as_size(nearest)];
  const auto before = as_size(at);
  const std::vector<double>&from = motion.frames[before], &to = motion.frames[before + 1];
  const double share = at - static_cast<double>(before);
  std::vector<double> dofs = from;
  for (std::size_t d = 0; d < dofs.size(); ++d) {
    double change = to[d] - from[d];
    if (turns[d] > 0.0) change = std::remainder(change, turns[d]);
    if (turns[d] > 0.0 && std::abs(change) > 0.25 * turns[d]) return motion.frames[as_size(nearest)];
    dofs[d] += share * change;
  }
  return dofs;
}

Motion resample(const Motion& motion, const Skeleton& skeleton, double step) {
  if (!(step > 0.0)) fail<UsageError>("cannot resample a motion in steps of {} frames; steps are positive", step);
  if (std::abs(step - 1.0) < kSameTime || motion.num_frames() < 2) return motion;
  const double last = motion.num_frames() - 1;
  if (last / step > kMaxResampled)
    fail<UsageError>("resampling {} frames in steps of {:g} frames gives more than a million; are the rates right?",
                     motion.num_frames(), step);
  const std::vector<double> turns = full_turns(skeleton);
  Motion result;
  for (long i = 0; static_cast<double>(i) * step <= last + kSameTime; ++i)
    result.frames.push_back(dofs_at(motion, turns, static_cast<double>(i) * step));
  result.ids.resize(result.frames.size());
  std::iota(result.ids.begin(), result.ids.end(), 0L);
  return result;
}

}  // namespace doppel
