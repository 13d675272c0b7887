#pragma once

#include "doppel/track/fit/track_config.h"
#include "doppel/track/footage.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct TrackOptions : TrackTask {
  TrackConfig config;
  bool surface = false;  ///< deform the surface to the masks: `<sequence>_graph.npy`
  int sheet_frames = 6;  ///< rows of `<sequence>.jpg`; 0: none
  /// Factors of the bones of the footage's character (scale_bones), for the report.
  std::vector<std::pair<std::string, double>> bone_scales;
};

/// Tracks sequences of a capture and writes into `options.out`:
/// - `<sequence>.motion`, `<sequence>.bvh`, and `<sequence>_vertices.npy` float32 [frames, N, 3] (world metres;
///   skinned, or deformed to the masks with `surface`, which also writes `<sequence>_graph.npy`)
/// - `<sequence>.jpg`: outlines of masks and of the fitted surface in some frames and cameras
/// - `capture.yaml`: the capture with these motions, ready for `doppel prepare`
/// - `track.json`: the report that is returned; `track.html`: its curves
/// @throws Error when no frame of a sequence can be tracked; UsageError for an unknown sequence
TrackReport track_capture(const Footage& footage, const TrackOptions& options);

}  // namespace doppel
