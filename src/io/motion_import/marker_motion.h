#pragma once

#include <filesystem>

#include "doppel/detect/keypoints/space_points.h"
#include "doppel/io/motion_import/source_motion.h"

namespace doppel {

/// The motion of a figure that points in space show (marker_people says which point shows which joint of whom). Of
/// several people it is `options.person`, else the first who shows a body, with a warning that names them. Its bones
/// have the median lengths of those in the points, and its rest pose is the T-pose of rest_figure.
///
/// The rotation of a joint is the one that takes its rest bones to those in the points. Of a single bone that leaves
/// the twist open: a bent knee or elbow states it by the axis of the bend, a straight one keeps that of the joint
/// above. Points that are missing for up to half a second are filled in by straight lines; after that a joint follows
/// the joint above it. The vertical is `options.up`, else what the file says, else y for a TRC file, else the axis
/// along which the head stands above the feet on average. A body that is far from it on average is a warning.
/// @throws Error when pelvis or hips, a knee and four more joints are not found (names the points of the file), a point
///   is never seen, more than 200000 frames, no frame rate; UsageError for a person who is not in the file
SourceMotion motion_of_points(const SpacePoints& points, const MotionSourceOptions& options);

/// The same of a C3D or TRC file. @throws FileError as read_space_points and motion_of_points
SourceMotion read_marker_motion(const std::filesystem::path& path, const MotionSourceOptions& options);

}  // namespace doppel
