#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "doppel/synth/actor.h"
#include "doppel/synth/clothing.h"
#include "doppel/synth/synth_options.h"

namespace doppel::synth {

/// What was made, for the summary.
struct SynthReport {
  int vertices = 0, faces = 0, nodes = 0, dofs = 0;
  double mean_displacement = 0, largest_displacement = 0;  ///< truth against the skinned template, metres, over clothes
  double skinning_iou = 0;  ///< of the skinned template's silhouette, mean over test frames and cameras
};

/// Makes a synthetic capture: an ordinary capture folder (docs/synth.md) with the true surfaces beside it.
///
/// The folder appears whole or not at all: everything is written into a temporary one beside it, which is renamed at
/// the end. The same options give the same content, whatever the number of threads.
/// @throws UsageError for options out of range, or when `folder` holds something and `force` is not given
/// @throws Error when interrupted, or when a file can't be written
SynthReport write_synthetic_capture(const std::filesystem::path& folder, const SynthOptions& options);

/// Where skinning alone puts every vertex.
/// @param offset added to the template's vertices before skinning, [N] or empty
/// @return [F] of [N] world metres
std::vector<Points> skin_motion(const Character& character, const Motion& motion, const Points& offset);

/// One continuous stretch of the performance and what the actor's surface really did.
struct Take {
  Motion motion;
  std::vector<Points> skinned, truth;  ///< [F] of [N] world metres
};
/// @param frames of the take; a lead-in, in which the clothes come to follow, is made up before it and dropped
Take perform(const Actor& actor, int frames, double fps, std::uint64_t seed, const ClothingOptions& clothing);

}  // namespace doppel::synth
