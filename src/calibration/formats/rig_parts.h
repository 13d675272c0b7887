#pragma once

/// What formats find out from all cameras of a rig together.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/calibration/formats/calibration.h"

namespace doppel {

/// The point that the cameras of a rig look at: the point nearest to all optical axes.
struct CommonView {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double median_distance = 0;  ///< from the point to the axes
  double median_depth = 0;     ///< of the point in the cameras
  int behind = 0;              ///< cameras that have the point behind them

  /// Whether all cameras look at one point. A wrong sense of the rotations spreads the axes or turns cameras away.
  bool holds() const;
};

/// Nothing for fewer than two cameras, for parallel axes and for numbers that are not finite.
std::optional<CommonView> common_view(const std::vector<Camera>& cameras);
/// Whether all cameras look at one point; false when it cannot be found.
bool look_at_one_point(const std::vector<Camera>& cameras);

/// Moves the origin near the cameras when coordinates exceed 1e5, as those of a map do, by a whole number of units, and
/// notes it.
void recentre_if_far(Calibration& calibration);

}  // namespace doppel
