#pragma once

#include <nlohmann/json.hpp>

#include "doppel/track/footage.h"
#include "doppel/fit/livecap/livecap_config.h"
#include "doppel/track/preview.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct LivecapCaptureOptions : TrackTask {
  LivecapConfig config;
  int sheet_frames = 6;  ///< rows of `<sequence>.jpg`; 0: none
};

/// Tracks sequences that one camera filmed. Images are read, decoded and cut out on one thread while another tracks
/// (4.7.3); no frame is dropped. Writes into `options.out` what `track_capture` writes; `<sequence>_vertices.npy` holds
/// the surface as it was tracked, filtered over time as the configuration says.
/// @param footage of one camera @param preview shows every frame; may be null
/// @return the report, with the IoU of the surface and of the skinned template with the masks
/// @throws UsageError for several cameras or an unknown sequence; Error when no frame of a sequence can be tracked
TrackReport track_livecap(const Footage& footage, const LivecapCaptureOptions& options, Preview* preview = nullptr);

}  // namespace doppel
