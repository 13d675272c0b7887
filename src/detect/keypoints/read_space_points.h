#pragma once

#include <filesystem>
#include <optional>

#include "doppel/detect/keypoints/space_points.h"

namespace doppel {

/// Reads points in space. The content decides the format:
/// - C3D (Vicon, Qualisys, OptiTrack, Theia): points of markers (c3d_file.h);
/// - TRC (OpenSim, Pose2Sim, OptiTrack, Vicon): `Units` of the file, usually y up; an empty cell is a missing point;
/// - Caliscope's table of one row per point, `sync_index`, `point_id` or `keypoint_id`, and `x_coord`, `y_coord`,
///   `z_coord`: metres; a missing point has no row;
/// - MMPose's 3D lifter: instances whose keypoints have three numbers, the first person of each frame: metres relative
///   to the person. A file of one image is frame 0.
/// @param metres_per_unit of a C3D or TRC file, in place of the unit that it states
/// @throws FileError (file:line) for another kind of file, an unknown unit, a number of columns that differs, and
/// points or frames given twice
SpacePoints read_space_points(const std::filesystem::path& path, std::optional<double> metres_per_unit = std::nullopt);

}  // namespace doppel
