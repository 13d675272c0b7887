#pragma once

#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/core/random.h"

namespace doppel {

/// A motion from which windows are drawn.
struct WindowSource {
  Motion motion;
  double step = 1.0;  ///< between two poses of a window, in frames of `motion`
};

/// Draws motion windows like those of some motions, but more varied, so that a function that is fitted to them holds
/// for other motions: at 0.5 to 2 times the speed, with limbs that do what they do at another time or in another
/// motion, and most of them with other angles and other speeds of all DoFs but the translations of the root.
class WindowMixer {
 public:
  /// @param past_frames F @throws UsageError without a frame
  WindowMixer(const Skeleton& skeleton, std::vector<WindowSource> sources, int past_frames);

  /// @return [F + 1][D], oldest first
  std::vector<std::vector<double>> draw(Random& random) const;

 private:
  std::vector<std::vector<double>> plain(Random& random) const;
  void add_noise(Random& random, std::vector<std::vector<double>>& window) const;

  std::vector<WindowSource> sources_;
  std::vector<int> ends_;  ///< frames of the sources up to each of them
  std::vector<double> turns_;
  std::vector<std::vector<int>> branches_;  ///< the DoFs of limbs, and of parts of limbs
  std::vector<double> spread_, speed_;      ///< [D] deviations of the DoFs, and of their changes from pose to pose
  int past_frames_;
};

}  // namespace doppel
