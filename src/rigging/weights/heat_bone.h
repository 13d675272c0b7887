#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace doppel {

/// A source of heat: the bone's name and the line segments that it consists of, metres in the rest pose.
struct HeatBone {
  std::string name;
  std::vector<std::array<Eigen::Vector3d, 2>> segments;
};

}  // namespace doppel
