#pragma once

#include <string>
#include <vector>

#include "doppel/train/stage_entry.h"

namespace doppel {

/// All stages, in the order they are trained in.
const std::vector<StageEntry>& stage_table();
/// @throws UsageError for a name that no stage has, with the nearest one
const StageEntry& stage_entry(const std::string& name);
/// The words that `stage:` takes: chains, and stages that may stand alone.
std::vector<std::string> stage_words();

}  // namespace doppel
