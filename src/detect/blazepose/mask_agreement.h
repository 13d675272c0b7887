#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

struct MaskAgreement {
  double share = 0.5;   ///< of the other views that see a point; so many must have it on their masks
  int tolerance = 3;    ///< pixels: a point that near to a mask is on the mask
  double step = 0.01;   ///< between tested points of a ray, metres
  double radius = 1.5;  ///< of the tested ball around the person, metres
};

/// Removes pixels that the other views contradict: those whose ray has no point in the visual hull of the others. A
/// view with a black or empty mask has no say, and neither has one at a point outside of its image. A pixel needs two
/// other views that see its point. Nothing is removed with fewer than three masks. The result does not depend on the
/// order of the views.
/// @param masks [C] at one moment, 0 or 255, sizes of the cameras
/// @param cameras [C] with their distortion
/// @return the number of removed pixels
/// @throws UsageError when numbers, sizes or types differ, and for a share outside of (0, 1], a tolerance below 0, or
/// a step or radius that is not positive
long drop_contradicted_pixels(std::vector<cv::Mat>& masks, std::span<const Camera> cameras,
                              const MaskAgreement& options = {});

}  // namespace doppel
