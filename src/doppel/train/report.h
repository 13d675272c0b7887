#pragma once

#include "doppel/train/run_folder.h"

namespace doppel {

/// Writes `report.html` from what the run folder holds: loss and other curves (metrics.jsonl), where a step's time
/// goes, the evaluation table (evaluation.json), pictures, configuration. One file without references to others; safe
/// to call at any time.
void write_report(const RunFolder& run);

}  // namespace doppel
