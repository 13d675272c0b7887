#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// Named points in space over time, as another program found them.
struct SpacePoints {
  std::string format;                 ///< c3d, trc, caliscope or mmpose
  std::string unit;                   ///< of the file: m, cm or mm
  double rate = 0.0;                  ///< frames per second; 0: the file does not say
  std::optional<Eigen::Vector3d> up;  ///< the vertical axis, where the file states one
  std::vector<std::string> names;     ///< [n] unique; the ids of points where the file has no names
  /// By frame as the file counts: [n] metres in the axes of the file; nothing where a point is missing.
  std::map<long, std::vector<std::optional<Eigen::Vector3d>>> frames;
};

/// Metres per unit of a file of points in space. @throws FileError unless the unit is m, cm or mm
double metres_of_unit(const std::string& unit, const FileLocation& where);

/// @throws FileError for a point farther than 100 km from the origin, metres
void require_near(const Eigen::Vector3d& point, const FileLocation& where);

}  // namespace doppel
