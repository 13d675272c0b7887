#pragma once

/// Errors of tracked surfaces against ground truth, where a capture has it (4.8).

#include <filesystem>
#include <optional>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/track/footage.h"

namespace doppel {

/// The mean distance of vertices from ground truth in each frame, millimetres, after the best translation. The
/// translation is removed because a single camera does not determine depth.
struct SurfaceErrors {
  std::vector<double> skinned;  ///< [frames] of the skinned template in the tracked pose
  std::vector<double> tracked;  ///< [frames] of the tracked surfaces; empty when none were written
};
/// @param vertices file of the tracked surfaces, float32 [frames,N,3]; empty: none was written
/// @return nothing where the capture has no `ground_truth/<sequence>/vertices.npy` (float32 [rows,N,3], world metres)
/// @throws Error when one of the files has another shape
std::optional<SurfaceErrors> surface_errors(const Footage& footage, const FootageSequence& sequence,
                                            const Motion& motion, const std::filesystem::path& vertices);

}  // namespace doppel
