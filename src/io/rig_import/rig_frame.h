#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "doppel/io/scene/scene.h"

namespace doppel {

/// The transform from a scene to a character's world, metres with y up: a rotation and a uniform scale.
/// @param points of the figure, scene coordinates: their height decides the unit where nobody states it
/// @param metres_per_unit, up ('x', 'y' or 'z') in place of what the file says
/// @param warnings a figure that is no person's size is named here
/// @throws Error when the points have no height
Eigen::Affine3d character_from_scene(const Scene& scene, const std::vector<Eigen::Vector3d>& points,
                                     std::optional<double> metres_per_unit, std::optional<char> up,
                                     std::vector<std::string>& warnings);

}  // namespace doppel
