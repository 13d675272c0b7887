#pragma once

#include <filesystem>

#include "doppel/io/scene/scene.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel {

/// Gives the faces of each further tile a material with the image of that tile, where the texture of a material is
/// spread over tiles: its name has a pattern, or the files of further tiles that the faces use exist.
/// @param path the file of the scene
void spread_tiles(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits);

}  // namespace doppel
