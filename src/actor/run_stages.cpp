#include "doppel/actor/run_stages.h"

#include <algorithm>

#include "doppel/actor/run_folder.h"

namespace doppel {

namespace fs = std::filesystem;

const std::vector<std::string>& ddc_stages() {
  static const std::vector<std::string> stages{"egnet", "lighting", "deltanet", "texnet", "gaussians"};
  return stages;
}

fs::path stage_folder(const fs::path& run, const std::string& stage) {
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  if (root.get("stage", "egnet") == stage) return run;
  const bool of_ddc = std::find(ddc_stages().begin(), ddc_stages().end(), stage) != ddc_stages().end();
  if (!root.has(stage)) return of_ddc && root.has(kDdcKey) ? stage_folder(root.path(kDdcKey), stage) : run / stage;
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
