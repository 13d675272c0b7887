#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/capture/keypoints.h"

namespace doppel {

/// A joint as a network that looks at one image places it in space.
struct JointDetection {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres, camera axes, from the body's root (mid-hip)
  bool seen = false;                                   ///< false: the network says nothing of it
};

/// Reads a table with the columns `frame,index,name,x_mm,y_mm,z_mm`: what such a network found in the frames of one
/// camera's video. x right, y down, z forward; relative to the body's root, so how far the person stands away is left
/// open. `index` is the point's place in the layout.
/// @return by video frame, [n] in the layout's order; frames and points that are not in the table are not seen
/// @throws FileError (file:line): another header, an index or a name that the layout does not have or that do not
///         belong together, a point given twice, farther than 10 m from the root, numbers that are none, no rows at all
std::map<long, std::vector<JointDetection>> read_joint_detections(const std::filesystem::path& csv,
                                                                  const PointLayout& layout);

}  // namespace doppel
