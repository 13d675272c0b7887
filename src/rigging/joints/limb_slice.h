#pragma once

#include <Eigen/Core>
#include <optional>

#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

/// The part of a solid's cross-section that is connected with the position nearest to a point.
struct LimbSlice {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the area, metres
  double radius = 0.0;                               ///< of a disc of the same area, metres
  double longest = 0.0;  ///< the largest standard deviation times 2: the half length of a long disc
  bool open = false;     ///< the area leaves the window: it holds more than a limb
};

/// @param point near the limb @param along normal of the plane, unit @param window half width of the part of the plane
///   that is looked at, metres; nothing inside of the solid within half the window gives no slice
std::optional<LimbSlice> slice_limb(const SolidGrid& solid, const Eigen::Vector3d& point, const Eigen::Vector3d& along,
                                    double window);

}  // namespace doppel
