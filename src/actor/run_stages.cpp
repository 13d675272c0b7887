#include "doppel/actor/run_stages.h"

#include <algorithm>

#include "doppel/actor/run_folder.h"

namespace doppel {

namespace fs = std::filesystem;

const std::vector<std::string>& ddc_stages() {
  static const std::vector<std::string> stages{"egnet", "lighting", "deltanet", "texnet", "gaussians"};
  return stages;
}

bool comes_from_ddc(const ConfigReader& root, const std::string& stage) {
  for (const std::string& earlier : ddc_stages()) {
    if (earlier == stage) return !root.has(stage);
    if (root.has(earlier) && !root.section(earlier).has("run")) return false;
  }
  return false;
}

fs::path stage_folder(const fs::path& run, const std::string& stage) {
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  if (root.get("stage", "egnet") == stage) return run;
  if (!root.has(stage))
    return root.has(kDdcKey) && comes_from_ddc(root, stage) ? stage_folder(root.path(kDdcKey), stage) : run / stage;
  const ConfigReader section = root.section(stage);
  return section.has("run") ? stage_folder(section.path("run"), stage) : run / stage;
}

RunSubject run_subject(const fs::path& run) {
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  return RunSubject::read(document, root, root.get("stage", "egnet"));
}

bool captures_poses(const fs::path& run) {
  if (!fs::exists(RunFolder(run).config())) return false;
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  return document.root().get("stage", "egnet") == std::string("posenet") || document.root().has("posenet");
}

}  // namespace doppel
