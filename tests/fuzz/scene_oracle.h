#pragma once

#include "doppel/scene/scene.h"
#include "doppel/scene/scene_limits.h"

namespace doppel::fuzz {

/// Checks what scene.h and read_scene.h promise of a scene that was read. @throws Broken
void check_scene(const Scene& scene, const SceneLimits& limits);

}  // namespace doppel::fuzz
