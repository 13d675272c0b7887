#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/progress.h"
#include "doppel/distributed/ranks.h"
#include "doppel/train/stage_chain.h"
#include "doppel/train/stage_table.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kTrainExample[] =
    "Example:\n"
    "  doppel train configs/small/ddc.yaml --set capture=prepared/anna --out runs/anna\n"
    "  doppel train configs/small/ddc.yaml --set capture=prepared/anna --out runs/anna --stages deltanet,texnet\n"
    "The same command resumes a stopped or killed run. docs/training.md lists the keys of CONFIG.";

struct TrainArguments {
  std::string config, out;
  std::vector<std::string> overrides, stages;
  bool resume = false, overwrite = false;
  RankFlags ranks;
};

/// Paths on the command line are relative to the working directory; paths in a file are relative to the file.
std::vector<std::string> absolute_capture(std::vector<std::string> overrides) {
  const std::string key = "capture=";
  for (std::string& text : overrides)
    if (text.rfind(key, 0) == 0 && text.size() > key.size())
      text =
          text_override("capture", fs::absolute(text_of_override(text.substr(key.size()))).lexically_normal().string());
  return overrides;
}

const char* word_for(StopReason reason) {
  return reason == StopReason::finished ? "finished" : reason == StopReason::time_limit ? "time limit" : "interrupted";
}

nlohmann::ordered_json to_json(const TrainSummary& summary) {
  return {{"reason", word_for(summary.reason)},   {"step", summary.step},
          {"resumed_at", summary.resumed_at},     {"seconds", summary.seconds},
          {"step_seconds", summary.step_seconds}, {"loss", summary.loss}};
}

void print_summaries(const std::vector<StageSummary>& summaries, const fs::path& out, bool single, bool json) {
  const fs::path report = out / "report.html";
  if (json) {
    nlohmann::ordered_json document = {{"run", out.string()}};
    for (const auto& [stage, summary] : summaries)
      if (single)
        document.update(to_json(summary));
      else
        document["stages"][stage] = to_json(summary);
    document["report"] = report.string();
    std::printf("%s\n", document.dump().c_str());
    return;
  }
  std::printf("run     %s\n", out.c_str());
  for (const auto& [stage, summary] : summaries)
    std::printf("%-9s %ld steps (%s) in %s, loss %.5g\n", stage.c_str(), static_cast<long>(summary.step),
                word_for(summary.reason), format_duration(summary.seconds).c_str(), summary.loss);
  std::printf("report  %s\n", report.c_str());
}

/// Trains, and tells the other ranks when this one fails.
std::vector<StageSummary> train_together(const StageChain& chain, const fs::path& out, const ChainOptions& options) {
  try {
    return train_stages(chain, out, options);
  } catch (const std::exception& e) {
    options.ranks->leave(e.what());
    throw;
  }
}

int run(const TrainArguments& arguments, const CommonOptions& common) {
  if (arguments.resume && arguments.overwrite) fail<UsageError>("--resume and --overwrite cannot be combined");
  std::vector<std::string> overrides = absolute_capture(arguments.overrides);
  const fs::path capture = StageChain::read(ConfigDocument::load(arguments.config, overrides)).capture();
  // The copy of the configuration in the run must not depend on its folder.
  overrides.push_back(text_override("capture", capture.string()));
  const StageChain chain = StageChain::read(ConfigDocument::load(arguments.config, overrides));
  ChainOptions options;
  for (const std::string& name : arguments.stages) options.stages.push_back(stage_entry(name).name);
  options.mode = arguments.resume ? RunMode::resume : arguments.overwrite ? RunMode::overwrite : RunMode::automatic;
  const fs::path out = arguments.out.empty() ? fs::path("runs") / chain.name() : fs::path(arguments.out);
  Ranks ranks(read_rank_options(arguments.ranks));
  if (!ranks.is_first()) setup_logging("warn");  // rank 0 speaks for all
  options.ranks = &ranks;
  const auto summaries = train_together(chain, out, options);
  if (ranks.is_first()) print_summaries(summaries, out, chain.single(), common.json);
  if (summaries.empty() || summaries.back().summary.reason != StopReason::interrupted) return 0;
  log::warn("stopped at step {} of {}; run the same command again{} to resume", summaries.back().summary.step,
            summaries.back().stage, arguments.overwrite ? " without --overwrite" : "");
  return 1;
}

}  // namespace

Command add_train(CLI::App& program) {
  CLI::App* app = program.add_subcommand("train", "Train an actor, stage by stage, on a prepared capture");
  app->footer(kTrainExample);
  auto arguments = std::make_shared<TrainArguments>();
  app->add_option("config", arguments->config, "YAML configuration, for instance configs/small/ddc.yaml")->required();
  app->add_option("--set", arguments->overrides, "Override a key: a.b=c (may be repeated)")->allow_extra_args(false);
  app->add_option("--out", arguments->out, "Folder of the run (default: runs/ and the name of the stage or chain)");
  app->add_option("--stages", arguments->stages,
                  "Stages of a chain to train: egnet,lighting,deltanet,texnet,gaussians; posenet,defnet; radiance "
                  "(default: those of CONFIG)")
      ->delimiter(',');
  app->add_flag("--resume", arguments->resume, "Resume a run; fail when there is none");
  app->add_option("--nodes", arguments->ranks.nodes, "Train with several processes: HOST:PORT of rank 0");
  app->add_option("--rank", arguments->ranks.rank, "The number of this process, from 0");
  app->add_option("--world", arguments->ranks.world, "The number of processes (docs/clusters.md)");
  app->add_flag("--overwrite", arguments->overwrite, "Replace the run in --out");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
