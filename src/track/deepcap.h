#pragma once

/// DeepCap on footage (5.8): what trained networks make of the images of one camera.

#include <filesystem>

#include "doppel/track/footage.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"
#include "doppel/track/track_view.h"

namespace doppel {

struct DeepcapOptions : TrackTask {
  std::filesystem::path run;  ///< of posenet, or of the chain deepcap
  double smoothing = 1.0;     ///< sigma of the Gaussian over five frames; 0: none (5.8)
  bool film = true;           ///< `<sequence>.mp4`
  TrackViewOptions view;      ///< how it is drawn
};

/// Captures sequences from one camera and writes into `options.out`:
/// - `<sequence>.motion`, `<sequence>.bvh`
/// - `<sequence>_graph.npy` float32 [frames, K, 6] (A, T of 5.9) with DefNet; `<sequence>_vertices.npy` float32
///   [frames, N, 3], world metres, where asked for
/// - `<sequence>.mp4`: the surface over the images, and from the side
/// - `capture.yaml`, `track.json`: as `track_capture`
/// Poses and deformations are smoothed over five frames; frames whose place could not be determined are listed, and
/// bridged from their neighbours.
/// @param footage of one camera
/// @throws UsageError for several cameras; Error when no frame of a sequence shows the person, or the run is of another
/// character
TrackReport track_deepcap(const Footage& footage, const DeepcapOptions& options);

}  // namespace doppel
