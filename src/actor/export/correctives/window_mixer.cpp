#include "doppel/actor/export/correctives/window_mixer.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "doppel/character/resample_motion.h"
#include "doppel/character/root_motion.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kMinTempo = 0.5, kMaxTempo = 2.0;
constexpr int kMaxSwaps = 3;         ///< limbs of a window that come from elsewhere
constexpr double kNoiseShare = 0.8;  ///< of the windows have noise
constexpr double kPoseNoise = 1.0;   ///< of the deviation of a DoF
constexpr double kSpeedNoise = 1.0;  ///< of the deviation of its change from pose to pose

/// The DoFs that move joints at or below each joint and none above; lists that repeat or hold all DoFs are left out.
std::vector<std::vector<int>> branches_of(const Skeleton& skeleton) {
  std::set<int> root;
  if (const auto travels = root_that_travels(skeleton)) root.insert(travels->rotation.begin(), travels->rotation.end());
  const auto is_below = [&](int joint, int above) {
    while (joint > above) joint = skeleton.joints[as_size(joint)].parent;
    return joint == above;
  };
  std::set<std::vector<int>> found;
  for (int above = 0; above < skeleton.num_joints(); ++above) {
    std::vector<int> branch;
    for (int d = 0; d < skeleton.num_dofs(); ++d) {
      const auto& drives = skeleton.dofs[as_size(d)].joints;
      if (!drives.empty() && std::all_of(drives.begin(), drives.end(),
                                         [&](const Dof::Drive& drive) { return is_below(drive.joint, above); }))
        branch.push_back(d);
    }
    const bool whole = branch.size() == as_size(skeleton.num_dofs()) ||
                       std::any_of(branch.begin(), branch.end(), [&](int d) { return root.count(d) > 0; });
    if (!branch.empty() && !whole) found.insert(branch);
  }
  return {found.begin(), found.end()};
}

double spread_of(const std::vector<double>& values) {
  double sum = 0.0, squares = 0.0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  const double count = std::max<double>(1.0, static_cast<double>(values.size())), mean = sum / count;
  return std::sqrt(std::max(0.0, squares / count - mean * mean));
}

/// From a hash of a uniform number, so that the bits do not depend on the standard library.
double normal_number(Random& random) { return hash_normal(static_cast<std::uint64_t>(random.uniform() * 0x1p53)); }

}  // namespace

WindowMixer::WindowMixer(const Skeleton& skeleton, std::vector<WindowSource> sources, int past_frames)
    : sources_(std::move(sources)),
      turns_(full_turns(skeleton)),
      branches_(branches_of(skeleton)),
      spread_(turns_.size(), 0.0),
      speed_(turns_.size(), 0.0),
      past_frames_(past_frames) {
  int frames = 0;
  for (const WindowSource& source : sources_) ends_.push_back(frames += source.motion.num_frames());
  if (frames == 0) fail<UsageError>("drawing motion windows: there are no frames to draw from");
  const auto root = root_that_travels(skeleton);
  for (std::size_t d = 0; d < turns_.size(); ++d) {
    if (root && std::count(root->translation.begin(), root->translation.end(), static_cast<int>(d)) > 0) continue;
    std::vector<double> values, changes;
    for (const auto& [motion, step] : sources_)
      for (std::size_t f = 0; f < motion.frames.size(); ++f) {
        if (f == 0) {
          values.push_back(motion.frames[0][d]);
          continue;
        }
        // An angle may jump by a full turn, which is no motion, and at a cut by any amount.
        double change = motion.frames[f][d] - motion.frames[f - 1][d];
        if (turns_[d] > 0.0) change = std::remainder(change, turns_[d]);
        values.push_back(values.back() + change);
        if (turns_[d] == 0.0 || std::abs(change) <= 0.25 * turns_[d]) changes.push_back(change * step);
      }
    spread_[d] = spread_of(values);
    speed_[d] = spread_of(changes);
  }
}

/// Part of a motion at another speed.
std::vector<std::vector<double>> WindowMixer::plain(Random& random) const {
  const int frame = random.index(ends_.back());
  const auto source = as_size(std::upper_bound(ends_.begin(), ends_.end(), frame) - ends_.begin());
  const double now = frame - (source == 0 ? 0 : ends_[source - 1]) + random.uniform(),
               tempo = kMinTempo * std::pow(kMaxTempo / kMinTempo, random.uniform());
  std::vector<std::vector<double>> rows;
  for (int i = past_frames_; i >= 0; --i)
    rows.push_back(dofs_at(sources_[source].motion, turns_, now - i * tempo * sources_[source].step));
  return rows;
}

void WindowMixer::add_noise(Random& random, std::vector<std::vector<double>>& window) const {
  for (std::size_t d = 0; d < spread_.size(); ++d) {
    const double pose = kPoseNoise * spread_[d] * normal_number(random),
                 speed = kSpeedNoise * speed_[d] * normal_number(random);
    for (int i = 0; i <= past_frames_; ++i) window[as_size(past_frames_ - i)][d] += pose + i * speed;
  }
}

std::vector<std::vector<double>> WindowMixer::draw(Random& random) const {
  std::vector<std::vector<double>> window = plain(random);
  const int swaps = branches_.empty() ? 0 : random.index(kMaxSwaps + 1);
  for (int s = 0; s < swaps; ++s) {
    const std::vector<std::vector<double>> other = plain(random);
    for (const int d : branches_[as_size(random.index(static_cast<int>(branches_.size())))])
      for (std::size_t i = 0; i < window.size(); ++i) window[i][as_size(d)] = other[i][as_size(d)];
  }
  if (random.uniform() < kNoiseShare) add_noise(random, window);
  return window;
}

}  // namespace doppel
