#pragma once

#include <optional>
#include <vector>

#include "doppel/track/root_rotation.h"

namespace doppel {

/// The poses of the last frames, as far as they are to be trusted, and where they lead.
class PoseHistory {
 public:
  /// @param last [D] the pose that counts as the last trusted one until there is another
  explicit PoseHistory(std::vector<double> last) : last_(std::move(last)) {}

  bool empty() const { return poses_.empty(); }
  /// The last pose that was trusted, however long ago.
  const std::vector<double>& last() const { return last_; }
  /// A new pose. @param follows whether it was found from those before
  void add(const std::vector<double>& dofs, bool follows);
  /// What comes next does not follow.
  void clear() { poses_.clear(); }
  /// The last two poses, continued at the same speed, turns of the root as matrices where `root` is given. Not to be
  /// asked for while empty.
  std::vector<double> predicted(const std::optional<RootRotation>& root) const;

 private:
  std::vector<std::vector<double>> poses_;  ///< up to two, oldest first
  std::vector<double> last_;
};

}  // namespace doppel
