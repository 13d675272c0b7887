#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "command.h"
#include "program.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kMergeExample[] =
    "Example:\n"
    "  doppel prepare recordings/anna --shard 0/2 --out parts/0\n"
    "  doppel prepare recordings/anna --shard 1/2 --out parts/1\n"
    "  doppel merge parts/0 parts/1 --out prepared/anna\n"
    "A folder of shards may stand for them: doppel merge parts --out prepared/anna (docs/clusters.md).";

struct MergeArguments {
  std::vector<fs::path> shards;
  fs::path out;
};

int run(const MergeArguments& arguments, const CommonOptions& common) {
  const ShardSet shards = find_shards(arguments.shards);
  check_empty(arguments.out);
  if (const int code = run_on_shards(shards, arguments.out, common)) return code;
  const std::string& command = shards.files.at(0).command();
  const nlohmann::ordered_json summary{
      {"command", command}, {"shards", shards.folders.size()}, {"out", arguments.out.string()}};
  if (common.json)
    fmt::print("{}\n", summary.dump());
  else
    fmt::print("{} shards of `doppel {}` are joined in {}\n", shards.folders.size(), command, arguments.out.string());
  return 0;
}

}  // namespace

Command add_merge(CLI::App& program) {
  CLI::App* app = program.add_subcommand(
      "merge", "Join the shards of synth, prepare, detect, track or evaluate: the result is that of one machine");
  app->footer(kMergeExample);
  auto arguments = std::make_shared<MergeArguments>();
  app->add_option("shards", arguments->shards, "Folders written with --shard i/n, or folders of such folders")
      ->required();
  app->add_option("--out", arguments->out, "Folder for the whole result; missing or empty")->required();
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
