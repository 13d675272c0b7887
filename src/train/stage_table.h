#pragma once

#include <string>
#include <vector>

#include "doppel/train/stage_entry.h"

namespace doppel {

/// All stages, in the order of training.
const std::vector<StageEntry>& stage_table();
/// @throws UsageError for an unknown name; the message suggests the nearest
const StageEntry& stage_entry(const std::string& name);
/// The valid values of `stage:`: chains, and stages that may be trained alone.
std::vector<std::string> stage_words();

}  // namespace doppel
