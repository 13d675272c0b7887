#pragma once

#include <filesystem>

#include "doppel/scene/scene.h"
#include "doppel/scene/scene_limits.h"

namespace doppel {

/// Readers of one format each. They return what the file says; read_scene calls finish_scene after them.
/// @throws FileError as read_scene
Scene read_gltf(const std::filesystem::path& path, const SceneLimits& limits);
Scene read_fbx(const std::filesystem::path& path, const SceneLimits& limits);
/// Collada, STL, PLY and OBJ by assimp.
Scene read_by_assimp(const std::filesystem::path& path, const SceneLimits& limits);

}  // namespace doppel
