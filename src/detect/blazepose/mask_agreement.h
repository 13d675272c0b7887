#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

struct MaskAgreement {
  double share = 0.5;           ///< of the other views that see a point; so many must have it on their masks
  double possible_share = 0.6;  ///< the same for a pixel that may show the person; of two others, both
  int tolerance = 3;            ///< pixels: a point that near to a mask is on the mask
  double step = 0.01;           ///< between tested points of a ray, metres
  double radius = 1.5;          ///< of the tested ball around the person, metres
};

/// How many pixels of the masks of a moment changed.
struct SettledPixels {
  long removed = 0, added = 0;
};

/// Decides which pixels of each view show the person, by the other views. A pixel is supported if a point of its ray
/// lies on enough of the other masks (`share`, `possible_share`); at least two other views must see the point. A view
/// with a black or empty mask has no say, and neither has one at a point outside of its image. The result does not
/// depend on the order of the views.
/// - Pixels of the person without support are removed, unless fewer than two other views have in their images the point
///   of the ray that is nearest to the person. Nothing is removed with fewer than three masks.
/// - Pixels that may show the person (kPossiblePerson) are added where they are supported and connected to the mask.
/// All
///   others become background.
/// @param masks [C] at one moment, of 0, kPossiblePerson and 255, sizes of the cameras; afterwards of 0 and 255
/// @param cameras [C] with their distortion
/// @throws UsageError when numbers, sizes or types differ, and for a share outside of (0, 1], a tolerance below 0, or
/// a step or radius that is not positive
SettledPixels settle_masks(std::vector<cv::Mat>& masks, std::span<const Camera> cameras,
                           const MaskAgreement& options = {});

}  // namespace doppel
