#pragma once

/// DeepCap (5.8): pose and surface from the images of one camera, by trained networks.

#include <filesystem>

#include "doppel/track/footage.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"
#include "doppel/track/track_view.h"

namespace doppel {

/// What is smoothed over time: poses and deformations, or the vertices of the surface, as in the thesis (5.8).
enum class DeepcapSmoothing { poses, vertices };

struct DeepcapOptions : TrackTask {
  std::filesystem::path run;  ///< of the stage posenet, or of the chain deepcap
  double smoothing = 1.0;     ///< sigma of the Gaussian, frames; 1: over five frames (5.8), 0: none
  /// With `vertices`, the motion and the graph are those of the networks, and film and vertices are `SmoothedSurfaces`.
  DeepcapSmoothing smoothed = DeepcapSmoothing::poses;
  bool film = true;       ///< `<sequence>.mp4`
  TrackViewOptions view;  ///< how the film is drawn
};

/// Tracks sequences of one camera and writes into `options.out`:
/// - `<sequence>.motion`, `<sequence>.bvh`
/// - `<sequence>_graph.npy` float32 [frames, K, 6] (A, T of 5.9) with DefNet; with `vertices`,
///   `<sequence>_vertices.npy` float32 [frames, N, 3], world metres
/// - `<sequence>.mp4`: the surface over the images, and from the side
/// - `capture.yaml`, `track.json`: as `track_capture`
/// Poses and deformations, or the surfaces, are smoothed over five frames. Lost frames are reported, and bridged from
/// their neighbours.
/// @param footage of one camera
/// @throws UsageError for several cameras; Error when all frames of a sequence are lost, or the run was trained for
/// another character
TrackReport track_deepcap(const Footage& footage, const DeepcapOptions& options);

}  // namespace doppel
