#pragma once

#include <filesystem>

#include "doppel/track/track_report.h"

namespace doppel {

/// Writes into `out`: `capture.yaml`, the capture with the tracked motions instead of its own; `track.json`, the
/// report; `track.html`, curves over time.
void write_results(const Footage& footage, const std::filesystem::path& out, const TrackReport& report);

}  // namespace doppel
