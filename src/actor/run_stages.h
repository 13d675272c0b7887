#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/actor/run_subject.h"

namespace doppel {

/// The key of a chain's configuration whose run lends the stages below to a hybrid.
inline constexpr char kDdcKey[] = "ddc";
/// The stages of the chain `ddc` (chapter 6), in the order they are trained in.
const std::vector<std::string>& ddc_stages();

/// The folder of a stage: the run itself for a run of that stage alone, else a folder of the stage's name in the run,
/// or the one that the run's configuration borrows the stage from.
/// @throws Error when `run` holds no config.yaml
std::filesystem::path stage_folder(const std::filesystem::path& run, const std::string& stage);

/// What the configuration of a run says of its subject. @throws Error when `run` holds no config.yaml
RunSubject run_subject(const std::filesystem::path& run);

/// Whether a folder is a run that captures poses from images: its configuration has the stage posenet.
/// @return false for a folder that is not a run @throws FileError when its configuration cannot be read
bool captures_poses(const std::filesystem::path& run);

}  // namespace doppel
