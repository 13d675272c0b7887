#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/actor/run_folder.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_path.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kCompareExample[] =
    "Example:\n"
    "  doppel compare runs/anna runs/anna-without-light --split test\n"
    "Compares the results that `doppel evaluate` wrote to evaluation.json of each run.";

struct CompareArguments {
  std::vector<std::string> runs;
  std::string split = "test";
};

/// A metric in the table.
struct Metric {
  const char* key;
  int digits;
};
constexpr Metric kMetrics[] = {{"AMVIoU", 4},
                               {"vertex_error_mm", 2},
                               {"Hausdorff_mm", 2},
                               {"normal_error_deg", 2},
                               {"roughness_error_mm", 2},
                               {"roughness_ratio", 3},
                               {"border_length_ratio", 3},
                               {"MSE", 2},
                               {"PSNR", 2},
                               {"SSIM", 4},
                               {"LPIPS", 4},
                               {"flicker", 2},
                               {"whole_MSE", 2},
                               {"scan_distance_mm", 2}};

Json read_evaluation(const fs::path& run, const std::string& split) {
  const fs::path file = RunFolder(run).evaluation();
  if (!fs::exists(file))
    fail("{} has no evaluation.json; run `doppel evaluate --run {}` first", run.string(), run.string());
  const Json evaluation = Json::parse(read_file(file), nullptr, false);
  if (evaluation.is_discarded() || !evaluation.is_object() || !evaluation.contains("splits"))
    fail("{} is not a file of `doppel evaluate`; evaluate the run again", file.string());
  if (!evaluation["splits"].contains(split))
    fail<UsageError>("{} has no {} split; run `doppel evaluate --run {} --split {}`", file.string(), split,
                     run.string(), split);
  return evaluation["splits"][split];
}

/// The metrics that at least one run has.
std::vector<Metric> used_metrics(const Json& runs) {
  std::vector<Metric> used;
  for (const Metric& metric : kMetrics)
    for (const auto& [run, methods] : runs.items())
      if (std::any_of(methods.begin(), methods.end(), [&](const Json& m) { return m.contains(metric.key); })) {
        used.push_back(metric);
        break;
      }
  return used;
}

std::string markdown(const Json& runs) {
  const std::vector<Metric> metrics = used_metrics(runs);
  std::string out = "| run | method |", rule = "|---|---|";
  for (const Metric& metric : metrics) {
    out += fmt::format(" {} |", metric.key);
    rule += "---:|";
  }
  out += "\n" + rule + "\n";
  for (const auto& [run, methods] : runs.items())
    for (const auto& [method, result] : methods.items()) {
      out += fmt::format("| {} | {} |", run, method);
      for (const Metric& metric : metrics)
        out += result.contains(metric.key)
                   ? fmt::format(" {:.{}f} |", result.at(metric.key).get<double>(), metric.digits)
                   : std::string(" |");
      out += "\n";
    }
  return out;
}

int run(const CompareArguments& arguments, const CommonOptions& common) {
  Json runs;
  for (const std::string& path : arguments.runs) {
    const fs::path folder = folder_path(fs::absolute(path));
    std::string name = folder.filename().string();
    if (runs.contains(name)) name = path;
    runs[name] = read_evaluation(folder, arguments.split);
  }
  std::printf("%s", common.json ? (runs.dump() + "\n").c_str() : markdown(runs).c_str());
  return 0;
}

}  // namespace

Command add_compare(CLI::App& program) {
  CLI::App* app = program.add_subcommand("compare", "Print the evaluations of several runs as one table (Markdown)");
  app->footer(kCompareExample);
  auto arguments = std::make_shared<CompareArguments>();
  app->add_option("runs", arguments->runs, "Folders of runs")->required();
  app->add_option("--split", arguments->split, "train, validation or test")->capture_default_str();
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
