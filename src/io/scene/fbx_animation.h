#pragma once

#include <map>

#include "doppel/io/scene/fbx_file.h"
#include "doppel/io/scene/scene.h"

namespace doppel {

/// FBX counts time in units of 1 / 46186158000 s, of which every usual frame rate has a whole number.
inline constexpr double kFbxTicksPerSecond = 46186158000.0;

/// The rotation of FBX Euler angles. @param order the property `RotationOrder`: 0 xyz, 1 xzy, 2 yzx, 3 yxz, 4 zxy,
///   5 zyx; the first axis is applied first. @param degrees about x, y, z
Eigen::Quaterniond fbx_rotation(int order, const Eigen::Vector3d& degrees);

/// Animations of an FBX file: one per stack, from its first layer. A curve with tangents becomes straight pieces.
/// @param node_of the node of each model
/// @throws Error for more keys than the limits allow
std::vector<SceneAnimation> read_fbx_animations(const FbxObjects& objects,
                                                const std::map<const FbxRecord*, int>& node_of,
                                                std::vector<std::string>& warnings, const SceneLimits& limits);

}  // namespace doppel
