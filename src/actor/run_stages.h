#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/actor/run_subject.h"

namespace doppel {

/// The configuration key of a ddc or hybrid that names the run with the stages before the first section.
inline constexpr char kDdcKey[] = "ddc";
/// The stages of the chain `ddc` (chapter 6, then the Gaussians), in the order they are trained in.
const std::vector<std::string>& ddc_stages();
/// Whether a run with the key `ddc` takes a stage without a section from that run: not if an earlier stage has a
/// section of its own, because the stage was trained on another surface. @param root the configuration
bool comes_from_ddc(const ConfigReader& root, const std::string& stage);

/// The folder of a stage. For a run of this stage alone, it is the run itself. Otherwise it is the folder of the
/// stage's name in the run, or the folder of the other run from which the run's configuration takes the stage.
/// @throws Error when `run` holds no config.yaml
std::filesystem::path stage_folder(const std::filesystem::path& run, const std::string& stage);

/// The subject in the configuration of a run. @throws Error when `run` holds no config.yaml
RunSubject run_subject(const std::filesystem::path& run);

/// Whether a folder is a run that captures poses from images, that is, its configuration has the stage posenet.
/// @return false for a folder that is not a run @throws FileError when its configuration cannot be read
bool captures_poses(const std::filesystem::path& run);

}  // namespace doppel
