#include "doppel/io/motion_import/vertical.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doppel/geometry/up_axis.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

/// Mean of directions of length 1 from which the body has one direction.
constexpr double kSteady = 0.5;
/// Cosine below which a body counts as lying, 60 degrees.
constexpr double kLying = 0.5;
/// Share of an axis in the mean direction from which the body stands along it.
constexpr double kClearlyAlong = 0.8;

/// "--up z", or what may be given where the body stands along the negative side of an axis.
std::string option_for(const Vector3d& axis) { return axis.sum() > 0 ? "--up " + axis_name(axis) : "--up x, y or z"; }

}  // namespace

std::optional<std::string> not_upright(const Vector3d& upward, const Vector3d& vertical, const std::string& reason) {
  if (upward.norm() < kSteady || upward.dot(vertical) > kLying * upward.norm()) return std::nullopt;
  const double degrees = std::acos(std::clamp(upward.normalized().dot(vertical), -1.0, 1.0)) * 180.0 / M_PI;
  const Vector3d along = nearest_axis(upward).axis;
  return fmt::format(
      "the body points along {} on average, {:.0f} degrees from the vertical; {} is the vertical, {}. If the person "
      "neither lies nor stands on the hands, state the vertical: {}",
      axis_name(along), degrees, axis_name(vertical), reason, option_for(along));
}

FoundVertical vertical_of(const SourceStance& stance) {
  FoundVertical found;
  const NearestAxis moving = nearest_axis(stance.motion);
  const bool clear = moving.cosine * stance.motion.norm() > kClearlyAlong;
  if (!stance.rest.isZero()) {
    const NearestAxis resting = nearest_axis(stance.rest);
    if (resting.cosine > kClearlyAlong && stance.motion.dot(resting.axis) > stance.motion.y()) {
      found.axis = resting.axis;
      found.note =
          fmt::format("the rest pose stands along {0}, so {0} is taken as the vertical", axis_name(resting.axis));
    }
    found.warning = not_upright(stance.motion, found.axis,
                                fmt::format("as {}", found.note ? "the rest pose says" : "usual in this format"));
  } else if (clear && moving.axis == Vector3d::UnitZ()) {
    found.axis = moving.axis;
    found.warning =
        "the body stands along z in the frames, so z is taken as the vertical; the rest pose does not say. If the "
        "person lies, state the vertical: --up y";
  } else {
    found.warning = not_upright(stance.motion, found.axis, "as usual in this format");
  }
  return found;
}

void turn_to_y_up(JointTracks& tracks, const Vector3d& up) {
  const Eigen::Affine3d turn(y_up_from_axis(up));
  for (auto& frame : tracks.frames)
    for (Eigen::Affine3d& joint : frame) joint = turn * joint;
}

}  // namespace doppel
