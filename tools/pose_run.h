#pragma once

#include <filesystem>

#include "doppel/train/run_folder.h"
#include "doppel/train/stage_chain.h"

namespace doppel::tools {

/// Whether a folder is a run that captures poses from pictures: of posenet, or of the chain of it and defnet. What is
/// not a run does not.
/// @throws FileError when its configuration cannot be read
inline bool captures_poses(const std::filesystem::path& run) {
  const std::filesystem::path config = RunFolder(run).config();
  return std::filesystem::exists(config) && StageChain::read(ConfigDocument::load(config)).has(StageKind::posenet);
}

}  // namespace doppel::tools
