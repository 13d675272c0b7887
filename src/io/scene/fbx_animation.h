#pragma once

#include <map>

#include "doppel/io/scene/fbx_file.h"
#include "doppel/io/scene/scene.h"

namespace doppel {

/// FBX up to version 7 counts time in units of 1 / 46186158000 s, of which every usual frame rate has a whole number.
inline constexpr double kFbxTicksPerSecond = 46186158000.0;
/// The units of a file: those, or 1 / 141120000 s in version 8, and in 7.7 where `TCDefinition` is not 127.
double fbx_ticks_per_second(const FbxRecord& root);

/// The rotation of FBX Euler angles. @param order the property `RotationOrder`: 0 xyz, 1 xzy, 2 yzx, 3 yxz, 4 zxy,
///   5 zyx; the first axis is applied first. @param degrees about x, y, z
Eigen::Quaterniond fbx_rotation(int order, const Eigen::Vector3d& degrees);

/// Animations of an FBX file: one per stack, from its first layer. A curve with tangents becomes straight pieces.
/// @param ticks_per_second of the file @param node_of the node of each model
/// @throws Error for more keys than the limits allow
std::vector<SceneAnimation> read_fbx_animations(const FbxObjects& objects, double ticks_per_second,
                                                const std::map<const FbxRecord*, int>& node_of,
                                                std::vector<std::string>& warnings, const SceneLimits& limits);

}  // namespace doppel
