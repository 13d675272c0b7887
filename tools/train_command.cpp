#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/progress.h"
#include "doppel/train/egnet_stage.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kExample[] =
    "Example:\n"
    "  doppel train configs/small/egnet.yaml --set capture=prepared/anna --out runs/anna\n"
    "The same command resumes a run that was stopped or killed. docs/training.md lists the keys of CONFIG.";

struct Arguments {
  std::string config, out;
  std::vector<std::string> overrides;
  bool resume = false, overwrite = false;
};

/// A path on the command line starts at the working directory, one in the file at the file.
std::vector<std::string> absolute_capture(std::vector<std::string> overrides) {
  const std::string key = "capture=";
  for (std::string& text : overrides)
    if (text.rfind(key, 0) == 0 && text.size() > key.size())
      text = key + fs::absolute(text.substr(key.size())).lexically_normal().string();
  return overrides;
}

void print_summary(const TrainSummary& summary, const fs::path& out, bool json) {
  const char* reason = summary.reason == StopReason::finished     ? "finished"
                       : summary.reason == StopReason::time_limit ? "time limit"
                                                                  : "interrupted";
  if (json) {
    const nlohmann::ordered_json document = {{"run", out.string()},
                                             {"reason", reason},
                                             {"step", summary.step},
                                             {"resumed_at", summary.resumed_at},
                                             {"seconds", summary.seconds},
                                             {"loss", summary.loss},
                                             {"report", (out / "report.html").string()}};
    std::printf("%s\n", document.dump().c_str());
    return;
  }
  std::printf("run     %s\nsteps   %ld (%s)\ntime    %s\nloss    %.5g\nreport  %s\n", out.c_str(),
              static_cast<long>(summary.step), reason, format_duration(summary.seconds).c_str(), summary.loss,
              (out / "report.html").c_str());
}

int run(const Arguments& arguments, const CommonOptions& common) {
  if (arguments.resume && arguments.overwrite) fail<UsageError>("--resume and --overwrite exclude each other");
  std::vector<std::string> overrides = absolute_capture(arguments.overrides);
  const EgNetRunConfig config = EgNetRunConfig::read(ConfigDocument::load(arguments.config, overrides));
  // The run's own copy must not depend on where it lies.
  overrides.push_back("capture=" + config.capture.string());
  const std::string resolved = ConfigDocument::load(arguments.config, overrides).resolved();
  const RunFolder folder(arguments.out);
  const RunMode mode = arguments.resume      ? RunMode::resume
                       : arguments.overwrite ? RunMode::overwrite
                                             : RunMode::automatic;

  const Dataset dataset = Dataset::open(config.capture);
  const Character character = load_character(dataset.character_path(), config.character);
  folder.open(resolved, mode);
  EgNetStage stage(dataset, character, config);
  const TrainSummary summary = Trainer(stage, config.trainer, folder).run();
  print_summary(summary, folder.path(), common.json);
  if (summary.reason != StopReason::interrupted) return 0;
  log::warn("stopped at step {}; the same command goes on from there", summary.step);
  return 1;
}

}  // namespace

Command add_train(CLI::App& program) {
  CLI::App* app = program.add_subcommand("train", "Train a stage on a prepared capture");
  app->footer(kExample);
  auto arguments = std::make_shared<Arguments>();
  app->add_option("config", arguments->config, "YAML configuration, for instance configs/small/egnet.yaml")->required();
  app->add_option("--set", arguments->overrides, "Override a key: a.b=c (may be repeated)")->allow_extra_args(false);
  arguments->out = "runs/egnet";
  app->add_option("--out", arguments->out, "Folder of the run")->capture_default_str();
  app->add_flag("--resume", arguments->resume, "Fail unless there is a run to resume");
  app->add_flag("--overwrite", arguments->overwrite, "Replace the run in --out");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
