#pragma once

#include "doppel/io/figure_export/euler_tracks.h"
#include "doppel/io/figure_export/fbx_document.h"

namespace doppel {

/// The objects whose properties an animation changes.
struct FbxMoved {
  std::vector<std::int64_t> bones;     ///< [B] models
  std::vector<std::int64_t> channels;  ///< [K] of the blend shapes
};

/// Adds the animation: one stack with one layer, and curves with straight lines between the keys of the tracks.
/// @param turns [B] rotations of the tracks @param name of the animation
void add_fbx_animation(FbxDocument& document, const FbxMoved& moved, const FigureTracks& tracks,
                       const std::vector<EulerTrack>& turns, const FbxClock& clock, const std::string& name);

}  // namespace doppel
