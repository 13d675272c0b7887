#pragma once

#include "doppel/data/doctor/body_track.h"

namespace doppel {

/// What may be wrong with a camera, as numbers that are fitted.
struct FreeParts {
  bool rotation = false, translation = false, focal = false, principal_point = false, distortion = false;
  int parameters() const { return 3 * rotation + 3 * translation + focal + 2 * principal_point + 2 * distortion; }
};

/// Fits parts of a camera to the points of the consensus by robust least squares (Geman-McClure, with a kernel that
/// narrows). `distortion` means k1 and k2 of a lens of Lens::opencv without further coefficients.
SupposedView fit_view(const Sightings& seen, int camera, SupposedView start, const BodyTrack& body,
                      const ChosenInstants& chosen, const FreeParts& parts);

/// A camera's pose from the points alone, by EPnP in RANSAC; nothing with fewer than six points.
std::optional<SupposedView> find_pose(const Sightings& seen, int camera, const SupposedView& start,
                                      const BodyTrack& body, const ChosenInstants& chosen);

/// The delay with the least residual, in rows: whole rows up to `longest`, then fractions.
/// @return the delay; nothing if fewer than half of the points are left at the best delay
std::optional<double> find_delay(const Sightings& seen, int camera, const SupposedView& view, const BodyTrack& body,
                                 const ChosenInstants& chosen, int longest);

}  // namespace doppel
