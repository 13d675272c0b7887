#pragma once

#include <filesystem>

#include "doppel/track/points/point_motion.h"

namespace doppel {

/// Writes a TRC file (OpenSim, Pose2Sim): metres, y up, the axes of Doppel's world. Frames are numbered from 1, which
/// is row 0 of the motion; the cells of a point that was not found are empty. read_space_points reads the file.
void write_trc(const std::filesystem::path& path, const PointMotion& motion);

/// Writes float32 [F, K, 3], world metres; not a number where a point was not found.
void write_point_array(const std::filesystem::path& path, const PointMotion& motion);

}  // namespace doppel
