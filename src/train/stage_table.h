#pragma once

#include <string>
#include <vector>

#include "doppel/train/stage_entry.h"

namespace doppel {

/// The entry of each stage; the files of the stage define it.
StageEntry egnet_entry();
StageEntry lighting_entry();
StageEntry delta_net_entry();
StageEntry tex_net_entry();
StageEntry gaussians_entry();
StageEntry hybrid_entry();
StageEntry nerf_entry();
StageEntry pose_net_entry();
StageEntry def_net_entry();

/// All stages, in the order of training.
const std::vector<StageEntry>& stage_table();
/// @throws UsageError for an unknown name; the message suggests the nearest
const StageEntry& stage_entry(const std::string& name);
/// The valid values of `stage:`: chains, and stages that may be trained alone.
std::vector<std::string> stage_words();

}  // namespace doppel
