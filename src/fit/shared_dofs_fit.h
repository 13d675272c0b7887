#pragma once

#include <vector>

#include "doppel/fit/multiview.h"

namespace doppel {

/// A frame whose pose is known but for the DoFs that are to be found.
struct PosedEvidence {
  FrameEvidence seen;        ///< [C]
  std::vector<double> dofs;  ///< [D]
};

/// The values that fit the outlines (and keypoints) of all frames best if each DoF has the same value in all of them.
/// They start from the rest pose and are drawn to it by `options.prior_weight` once, not once a frame.
/// @param dofs none of which moves the whole body @param landmarks, cameras as for `MultiviewTracker`
/// @return [dofs] @throws UsageError for a DoF that moves the whole body; Error without frames
std::vector<double> fit_shared_dofs(const Character& character, const std::vector<Marker>& landmarks,
                                      const std::vector<Camera>& cameras, const std::vector<int>& dofs,
                                      const std::vector<PosedEvidence>& frames, const MultiviewOptions& options);

}  // namespace doppel
