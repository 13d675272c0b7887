#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/eval/silhouette_overlap.h"
#include "doppel/train/adapt.h"

namespace doppel::tools {

namespace {

constexpr char kAdaptExample[] =
    "Example:\n"
    "  doppel prepare clips/park --out prepared/park\n"
    "  doppel adapt --run runs/anna-deepcap --capture prepared/park --out runs/anna-park\n"
    "The studio run is only read. The new run is used like any other. docs/training.md lists the keys of --config.";

struct AdaptArguments {
  std::string config;
  std::vector<std::string> set;
  AdaptOptions options;
};

int run(const AdaptArguments& arguments, const CommonOptions& common) {
  AdaptOptions options = arguments.options;
  options.config =
      AdaptConfig::read(arguments.config.empty() ? ConfigDocument::parse("{}", "the defaults", arguments.set)
                                                 : ConfigDocument::load(arguments.config, arguments.set));
  const nlohmann::ordered_json report = adapt(options);
  std::printf("%s", common.json ? (report.dump() + "\n").c_str() : evaluation_table(report).c_str());
  return 0;
}

}  // namespace

Command add_adapt(CLI::App& program) {
  CLI::App* app = program.add_subcommand("adapt", "Fine-tune a run of posenet or deepcap to a clip from one camera");
  app->footer(kAdaptExample);
  auto arguments = std::make_shared<AdaptArguments>();
  AdaptOptions& options = arguments->options;
  app->add_option("--run", options.run, "The studio run: posenet, or the chain deepcap")->required();
  app->add_option("--capture", options.capture,
                  "Prepared capture of the clip, with masks and keypoints; no motion is needed")
      ->required();
  app->add_option("--out", options.out, "Folder of the new run")->required();
  app->add_option("--camera", options.camera, "The clip's camera (default: its first)");
  app->add_option("--config", arguments->config, "YAML configuration, for instance configs/small/adapt.yaml");
  app->add_option("--set", arguments->set, "Override a key: a.b=c (may be repeated)")->allow_extra_args(false);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
