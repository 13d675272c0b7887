#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// A 3D joint as estimated by a network from one image.
struct JointDetection {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres, camera axes, relative to the body's root (mid-hip)
  bool seen = false;                                   ///< false: the network gives no estimate
};

/// Whether a file begins with the header of a table of joints in space. False for a file that cannot be read.
bool is_joint_table(const std::filesystem::path& path);

/// Reads a table with the columns `frame,index,name,x_mm,y_mm,z_mm`: the estimates of such a network in the frames of
/// one camera's video. x right, y down, z forward, relative to the root of the body; the distance of the person from
/// the camera is unknown. `index` is the index of the point in the layout.
/// @return by video frame, [n] in the order of the layout; frames and points that are not in the table are not seen
/// @throws FileError (file:line): another header, an index or a name that the layout does not have, an index and a name
/// of different points, a point given twice or farther than 10 m from the root, an invalid number, no rows
std::map<long, std::vector<JointDetection>> read_joint_detections(const std::filesystem::path& csv,
                                                                  const PointLayout& layout);

}  // namespace doppel
