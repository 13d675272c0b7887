#pragma once

#include <vector>

#include "doppel/track/multiview/multiview.h"

namespace doppel {

/// A frame whose pose is known except for the shared DoFs.
struct PosedEvidence {
  FrameEvidence seen;        ///< [C]
  std::vector<double> dofs;  ///< [D]
};

/// Fits one value per DoF to the outlines and keypoints of all frames. The fit starts from the rest pose. The prior
/// `options.prior_weight` counts once, not once per frame.
/// @param dofs the shared DoFs; none may move the whole body @param landmarks, cameras as for `MultiviewTracker`
/// @return [dofs] @throws UsageError for a DoF that moves the whole body; Error without frames
std::vector<double> fit_shared_dofs(const Character& character, const std::vector<Marker>& landmarks,
                                    const std::vector<PinholeCamera>& cameras, const std::vector<int>& dofs,
                                    const std::vector<PosedEvidence>& frames, const MultiviewOptions& options);

}  // namespace doppel
