#pragma once

/// How far what was tracked is from the truth, where a capture knows it (4.8).

#include <filesystem>
#include <optional>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/track/footage.h"

namespace doppel {

/// Of each frame the mean distance of vertices from the true ones, millimetres, after the shift that fits best: a
/// single camera does not tell depth.
struct SurfaceErrors {
  std::vector<double> skinned;  ///< [frames] of the template in the tracked pose
  std::vector<double> tracked;  ///< [frames] of the surfaces in the file of tracked surfaces; empty without it
};
/// @param vertices the file of the tracked surfaces, float32 [frames,N,3]; empty: none was written
/// @return nothing where the capture has no `ground_truth/<sequence>/vertices.npy` (float32 [rows,N,3], world metres)
/// @throws Error when one of the files has another shape
std::optional<SurfaceErrors> surface_errors(const Footage& footage, const FootageSequence& sequence,
                                            const Motion& motion, const std::filesystem::path& vertices);

}  // namespace doppel
