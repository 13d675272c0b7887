#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "doppel/synth/actor.h"
#include "doppel/synth/clothing.h"
#include "doppel/synth/synth_options.h"

namespace doppel::synth {

/// Statistics of the synthetic capture, for the summary.
struct SynthReport {
  int vertices = 0, faces = 0, nodes = 0, dofs = 0;
  double mean_displacement = 0, largest_displacement = 0;  ///< from the skinned template, metres, over clothes
  double skinning_iou = 0;  ///< of the skinned template's silhouette, mean over test frames and cameras
};

/// Writes a synthetic capture: an ordinary capture folder (docs/synth.md) with the true surfaces beside it.
///
/// The files are written into a temporary folder beside `folder`, which is renamed at the end; an interrupted run
/// leaves no partial capture. The same options give the same content for any number of threads.
/// @throws UsageError for options out of range, or when `folder` is not empty and `force` is not set
/// @throws Error when interrupted, or when a file can't be written
SynthReport write_synthetic_capture(const std::filesystem::path& folder, const SynthOptions& options);

/// The skinned positions of all vertices for every frame of a motion.
/// @param offset added to the template's vertices before skinning, [N] or empty
/// @return [F] of [N] world metres
std::vector<Points> skin_motion(const Character& character, const Motion& motion, const Points& offset);

/// One continuous motion with the skinned and the true surface.
struct Take {
  Motion motion;
  std::vector<Points> skinned, ground_truth;  ///< [F] of [N] world metres
};
/// @param frames of the take. A lead-in for the cloth simulation is generated before the take and dropped.
/// @param turn mean speed of the turn about the vertical axis, radians per second
Take perform(const Actor& actor, int frames, double fps, std::uint64_t seed, const ClothOptions& cloth,
             double turn = 0.0);

}  // namespace doppel::synth
