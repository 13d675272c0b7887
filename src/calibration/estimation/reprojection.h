#pragma once

#include <optional>
#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"
#include "doppel/geometry/triangulation.h"

namespace doppel {

/// The width of an image in whose pixels thresholds and kernels count, so that they mean the same at any resolution.
constexpr double kRigReferenceWidth = 1024.0;
inline double rig_reference_pixels(const Camera& camera) { return kRigReferenceWidth / camera.width; }

/// A point of the person as one camera saw it.
struct SeenFrom {
  int camera = 0;
  TrackPoint seen;
};
/// Which cameras see a point at a common time, with where they see it.
std::vector<SeenFrom> seen_at(const PointTracks& tracks, double seconds, int point);

/// Triangulates a point robustly. The threshold counts in pixels of an image 1024 wide. The residuals have the order of
/// `seen`; a pixel that no lens can see has an infinite residual.
std::optional<TriangulatedPoint> triangulate(const std::vector<Camera>& cameras, const std::vector<SeenFrom>& seen,
                                             const TriangulationOptions& options);

/// [C] the distances, in pixels, of what each camera saw from points triangulated robustly from all cameras.
/// @param times seconds
std::vector<std::vector<double>> reprojection_distances(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                                        const std::vector<double>& times);

}  // namespace doppel
