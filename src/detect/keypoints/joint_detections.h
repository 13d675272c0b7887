#pragma once

#include <filesystem>
#include <map>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// Whether a file begins with the header of a table of joints in space. False for a file that cannot be read.
bool is_joint_table(const std::filesystem::path& path);

/// Reads a table with the columns `frame,index,name,x_mm,y_mm,z_mm`: the estimates of such a network in the frames of
/// one camera's video. x right, y down, z forward, relative to the root of the body; the distance of the person from
/// the camera is unknown. `index` is the index of the point in the layout of the table: the given layout, or a built-in
/// one that fits every row (a table of `doppel detect` beside the keypoints of another detector). Points are then found
/// by their names, and those that the given layout does not have are left out.
/// @return by video frame, [n] in the order of the given layout; frames and points that are not in the table are not
/// seen; the noise is that of BlazePose for a table in one of its layouts
/// @throws FileError (file:line): another header, an index or a name that the layout does not have, an index and a name
/// of different points, a point given twice or farther than 10 m from the root, an invalid number, no rows
std::map<long, std::vector<JointDetection>> read_joint_detections(const std::filesystem::path& csv,
                                                                  const PointLayout& layout);

}  // namespace doppel
