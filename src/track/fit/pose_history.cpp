#include "doppel/track/fit/pose_history.h"

namespace doppel {

void PoseHistory::remember(const TrackedFrame& frame) {
  if (frame.state != FrameState::tracked) clear();
  if (!frame.found()) return;
  poses_.push_back(frame.dofs);
  if (poses_.size() > 2) poses_.erase(poses_.begin());
  last_ = frame.dofs;
  segment_begins_ = false;
}

void PoseHistory::cut() {
  clear();
  segment_begins_ = true;
}

std::vector<double> PoseHistory::predicted(const std::optional<RootRotation>& root) const {
  const std::vector<double>& last = poses_.back();
  if (poses_.size() < 2) return last;
  std::vector<double> next = last;
  for (std::size_t d = 0; d < next.size(); ++d) next[d] += last[d] - poses_.front()[d];
  if (root) {
    const Eigen::Matrix3d before = root->matrix(poses_.front()), now = root->matrix(last);
    for (const int dof : root->root().rotation) next[dof] = last[dof];
    root->set_matrix(next, now * before.transpose() * now);
  }
  return next;
}

}  // namespace doppel
