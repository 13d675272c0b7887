#include "doppel/actor/run_stages.h"

#include <algorithm>
#include <optional>

#include "doppel/actor/run_folder.h"
#include "doppel/core/error.h"

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

namespace {

constexpr int kMaxBorrowed = 32;  // runs that take a stage one from the other

fs::path stage_folder_within(const fs::path& run, const std::string& stage, int more_runs) {
  if (more_runs == 0)
    fail("{}: the runs that take {} from each other go in a circle; correct `run` or `{}` in their config.yaml",
         run.string(), stage, kDdcKey);
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  if (root.get("stage", "egnet") == stage) return run;
  std::optional<fs::path> borrowed;
  if (!root.has(stage)) {
    if (root.has(kDdcKey) && comes_from_ddc(root, stage)) borrowed = root.path(kDdcKey);
  } else if (const ConfigReader section = root.section(stage); section.has("run")) {
    borrowed = section.path("run");
  }
  return borrowed ? stage_folder_within(*borrowed, stage, more_runs - 1) : run / stage;
}

}  // namespace

fs::path stage_folder(const fs::path& run, const std::string& stage) {
  return stage_folder_within(run, stage, kMaxBorrowed);
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
