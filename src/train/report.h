#pragma once

#include <string>
#include <vector>

#include "doppel/actor/run_folder.h"

namespace doppel {

/// Writes `report.html` from what the run folder holds: loss and other curves (metrics.jsonl), where a step's time
/// goes, the evaluation table (evaluation.json), images, configuration. One file without references to others; safe
/// to call at any time.
void write_report(const RunFolder& run);

/// A run folder shown as a part of the report of another.
struct ReportSection {
  std::string title;
  RunFolder run;
};
/// The same for a run made of several: its own evaluation and configuration, and of each part what it would show alone.
void write_report(const RunFolder& run, const std::vector<ReportSection>& sections);

}  // namespace doppel
