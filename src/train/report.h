#pragma once

#include <string>
#include <vector>

#include "doppel/actor/run_folder.h"

namespace doppel {

/// Writes `report.html` from the files of the run folder: the result in a sentence and a few figures (evaluation.json),
/// images, curves (metrics.jsonl), times of the parts of a step, the evaluation table, and folded protocol and
/// configuration. The file refers to no others. Safe to call at any time.
void write_report(const RunFolder& run);

/// A run folder that the report of another run includes.
struct ReportSection {
  std::string title;
  RunFolder run;
};
/// The same for a run with several parts: its own evaluation and configuration, then the training of each part.
void write_report(const RunFolder& run, const std::vector<ReportSection>& sections);

}  // namespace doppel
