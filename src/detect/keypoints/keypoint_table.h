#pragma once

#include <filesystem>
#include <map>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// Writes the points of one camera as Doppel's own table, `frame,name,x,y,confidence`: the seen points of the first
/// person in each frame. When no point is seen in any frame, the table gets one row with confidence 0, which records
/// that the camera was processed. read_all_people reads the table.
void write_keypoint_table(const std::filesystem::path& path, const PointLayout& layout,
                          const std::map<long, People>& frames);

/// Whether a file is a table of points with one row each, by its first line: columns of the frame, of the point and of
/// x and y, in any order and under any of their usual names. Columns of the camera, of the person and of the confidence
/// may be there.
bool is_keypoint_table(const std::filesystem::path& path);

}  // namespace doppel
