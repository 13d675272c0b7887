#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// Named points in space over time, as another program found them.
struct SpacePoints {
  std::string format;              ///< trc, caliscope or mmpose
  std::string unit;                ///< of the file: m, cm or mm
  double rate = 0.0;               ///< frames per second; 0: the file does not say
  std::vector<std::string> names;  ///< [n] unique; the ids of points where the file has no names
  /// By frame as the file counts: [n] metres in the axes of the file; nothing where a point is missing.
  std::map<long, std::vector<std::optional<Eigen::Vector3d>>> frames;
};

/// Reads points in space. The content decides the format:
/// - TRC (OpenSim, Pose2Sim, OptiTrack, Vicon): `Units` of the file, usually y up; an empty cell is a missing point;
/// - Caliscope's table of one row per point, `sync_index`, `point_id` or `keypoint_id`, and `x_coord`, `y_coord`,
///   `z_coord`: metres; a missing point has no row;
/// - MMPose's 3D lifter: instances whose keypoints have three numbers, the first person of each frame: metres relative
///   to the person. A file of one image is frame 0.
/// @throws FileError (file:line) for another kind of file, an unknown unit, a number of columns that differs, and
/// points or frames given twice
SpacePoints read_space_points(const std::filesystem::path& path);

}  // namespace doppel
