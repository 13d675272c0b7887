#pragma once

#include "doppel/geometry/mesh.h"
#include "doppel/io/scene/scene.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel::fuzz {

/// Checks what scene.h and read_scene.h promise of a scene that was read. @throws Broken
void check_scene(const Scene& scene, const SceneLimits& limits);

/// Checks what mesh.h promises of a mesh that was read. @throws Broken
void check_triangles(const TriangleMesh& mesh);

}  // namespace doppel::fuzz
