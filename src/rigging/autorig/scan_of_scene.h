#pragma once

#include "doppel/io/scene/scene.h"
#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {

/// The surfaces of a file as parts of a scan: each primitive in the file's coordinates, without animation, a skinned
/// primitive as its joints pose it.
ScanParts scan_of_scene(const Scene& scene);

}  // namespace doppel
