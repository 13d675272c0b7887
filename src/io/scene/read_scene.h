#pragma once

#include <filesystem>

#include "doppel/io/scene/scene.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel {

/// Reads glTF 2.0 (.gltf, .glb, .vrm), FBX (.fbx, binary and text), Collada (.dae), STL, PLY and OBJ. The format is
/// found by the content where it has a mark, else by the extension. Polygons are split into triangles. Weights are
/// normalised. Lines, points and cameras are left out. Faults that can be mended are mended and named in `warnings`.
/// @throws FileError with the file and, where it is known, the position in it: truncated, no triangles, NaN, an index
/// out
///   of range, nodes in a circle, a compression that is not read, counts beyond the limits
Scene read_scene(const std::filesystem::path& path, const SceneLimits& limits = {});

}  // namespace doppel
