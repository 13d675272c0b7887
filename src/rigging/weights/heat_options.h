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

struct HeatOptions {
  double thickness = 0.25;  ///< of a bone: the share of its distance to the surface that it fills
  double sharpness = 2.0;   ///< power of the weights; above 1 the transition at a joint becomes shorter
  double air = 1e-4;        ///< conduction of the cells around the body, relative to those inside
  double wall = 0.1;        ///< conduction through a surface inside of the solid: skin under clothes, touching limbs
  int smoothing = 3;        ///< rounds of averaging over the edges of the mesh
};

}  // namespace doppel
