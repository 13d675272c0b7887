#pragma once

#include <optional>
#include <vector>

#include "doppel/geometry/triangulation.h"
#include "doppel/track/energy/evidence.h"

namespace doppel {

/// Triangulates a landmark from the cameras that see it with at least kSeenConfidence, weighted by confidence.
/// Residuals and the inlier threshold count in reference pixels. `residuals` of the result has an entry for each of
/// these cameras.
/// @return nothing when no point has two inlier views
std::optional<TriangulatedPoint> triangulate(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                             int landmark, const TriangulationOptions& options = {});

/// All landmarks of a frame, [M].
std::vector<std::optional<TriangulatedPoint>> triangulate_all(const std::vector<PinholeCamera>& cameras,
                                                              const FrameEvidence& frame, int num_landmarks);

}  // namespace doppel
