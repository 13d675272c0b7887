#pragma once

#include <filesystem>

#include "doppel/io/scene/scene.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel {

/// Readers of one format each. They return what the file says; read_scene calls finish_scene after them.
/// @throws FileError as read_scene
Scene read_gltf(const std::filesystem::path& path, const SceneLimits& limits);
Scene read_fbx(const std::filesystem::path& path, const SceneLimits& limits);
/// Text and binary; equal positions become one vertex.
Scene read_stl(const std::filesystem::path& path, const SceneLimits& limits);
/// Text and binary of both orders of bytes.
Scene read_ply(const std::filesystem::path& path, const SceneLimits& limits);
/// With its MTL files and textures.
Scene read_obj_scene(const std::filesystem::path& path, const SceneLimits& limits);
/// By assimp.
Scene read_collada(const std::filesystem::path& path, const SceneLimits& limits);

}  // namespace doppel
