#pragma once

#include <nlohmann/json.hpp>

#include "doppel/track/footage.h"
#include "doppel/track/livecap/livecap_config.h"
#include "doppel/track/preview.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct LivecapCaptureOptions : TrackTask {
  LivecapConfig config;
  int sheet_frames = 6;  ///< rows of `<sequence>.jpg`; 0: none
};

/// Tracks sequences of one camera. One thread reads and decodes images and finds masks while another tracks (4.7.3); no
/// frame is dropped. Writes the files of `track_capture` into `options.out`; `<sequence>_vertices.npy` holds the
/// tracked surface, filtered over time when the configuration has `filter`.
/// @param footage of one camera @param preview shows every frame; may be null
/// @return the report, with the IoU of the surface and of the skinned template with the masks
/// @throws UsageError for several cameras or an unknown sequence; Error when no frame of a sequence can be tracked
TrackReport track_livecap(const Footage& footage, const LivecapCaptureOptions& options, Preview* preview = nullptr);

}  // namespace doppel
