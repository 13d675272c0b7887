#pragma once

#include <filesystem>

#include "doppel/detect/keypoints/space_points.h"
#include "doppel/io/motion_import/source_motion.h"

namespace doppel {

/// The motion of a figure that points in space show (match_markers says which point shows which joint). Its bones have
/// the median lengths of those in the points, and its rest pose is the T-pose of rest_figure.
///
/// The rotation of a joint is the one that takes its rest bones to those in the points. Of a single bone that leaves
/// the twist open: a bent knee or elbow states it by the axis of the bend, a straight one keeps that of the joint
/// above. Points that are missing for up to half a second are filled in by straight lines; after that a joint follows
/// the joint above it. The vertical is `options.up`, else the axis along which the head stands above the feet on
/// average, if this is clear, else what the file says.
/// @throws Error when pelvis or hips, a knee and four more joints are not found (names the points of the file), a point
///   is never seen, more than 200000 frames, no frame rate
SourceMotion motion_of_points(const SpacePoints& points, const MotionSourceOptions& options);

/// The same of a C3D or TRC file. @throws FileError as read_space_points and motion_of_points
SourceMotion read_marker_motion(const std::filesystem::path& path, const MotionSourceOptions& options);

}  // namespace doppel
