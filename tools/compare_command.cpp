#include <fmt/ranges.h>

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
#include "doppel/data/capture/capture.h"
#include "doppel/eval/evaluation_columns.h"

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

/// A condition of an evaluation that must be the same for a fair comparison.
struct Condition {
  const char* name;
  const char* pointer;    ///< in the protocol, as a JSON pointer; SPLIT stands for the name of the split
  bool only_where_known;  ///< a run without it has no figures that depend on it
};
constexpr Condition kConditions[] = {{"capture", "/capture", false},
                                     {"every", "/every", false},
                                     {"only_frames", "/only_frames", false},
                                     {"frames", "/frames/SPLIT", false},
                                     {"cameras", "/cameras", false},
                                     {"resolution", "/resolution", false},
                                     {"input_camera", "/input_camera", false},
                                     {"smoothing", "/smoothing", true},
                                     {"crop", "/pictures/crop", true},
                                     {"scans", "/scans/folder", true},
                                     {"metres_per_unit", "/scans/metres_per_unit", true},
                                     {"frames with a scan", "/scans/frames/SPLIT", true}};

/// An evaluation of a run: its protocol, and the rows of one split.
struct Evaluation {
  std::string run;
  Json protocol, methods;
};

Evaluation read_evaluation(const fs::path& run, const std::string& split) {
  const fs::path file = RunFolder(run).evaluation();
  if (!fs::exists(file))
    fail("{} has no evaluation.json; run `doppel evaluate --run {}` first", run.string(), run.string());
  const Json evaluation = Json::parse(read_file(file), nullptr, false);
  if (evaluation.is_discarded() || !evaluation.is_object() || !evaluation.contains("splits") ||
      !evaluation["splits"].is_object())
    fail("{} is not a file of `doppel evaluate`; evaluate the run again", file.string());
  const Json& splits = evaluation["splits"];
  if (!splits.contains(split)) {
    std::vector<std::string> held;
    for (const auto& [name, rows] : splits.items()) held.push_back("--split " + name);
    fail<UsageError>("{} has no {} split; give {}, or run `doppel evaluate --run {} --split {}`", file.string(), split,
                     fmt::join(held, " or "), run.string(), split);
  }
  return {"", evaluation.value("protocol", Json::object()), splits[split]};
}

/// The columns that at least one run has.
std::vector<EvaluationColumn> used_columns(const std::vector<Evaluation>& runs) {
  std::vector<EvaluationColumn> used;
  for (const EvaluationColumn& column : kEvaluationColumns)
    if (std::any_of(runs.begin(), runs.end(), [&](const Evaluation& run) {
          return std::any_of(run.methods.begin(), run.methods.end(), [&](const Json& row) { return column.find(row); });
        }))
      used.push_back(column);
  return used;
}

std::string markdown(const std::vector<Evaluation>& runs) {
  const std::vector<EvaluationColumn> columns = used_columns(runs);
  std::string out = "| run | method |", rule = "|---|---|";
  for (const EvaluationColumn& column : columns) {
    out += fmt::format(" {}{} |", column.key, column.factor == 1 ? "" : column.unit);  // the keys name their units
    rule += "---:|";
  }
  out += "\n" + rule + "\n";
  for (const Evaluation& run : runs)
    for (const auto& [method, row] : run.methods.items()) {
      out += fmt::format("| {} | {} |", run.run, method);
      for (const EvaluationColumn& column : columns) {
        const Json* value = column.find(row);
        out += value ? " " + column.text(*value) + " |" : std::string(" |");
      }
      out += "\n";
    }
  return out;
}

/// The value of each run for the conditions that are not the same in all; null for a run without it.
Json differences(const std::vector<Evaluation>& runs, const std::string& split) {
  Json result = Json::object();
  for (const Condition& condition : kConditions) {
    std::string pointer = condition.pointer;
    if (const std::size_t at = pointer.find("SPLIT"); at != std::string::npos) pointer.replace(at, 5, split);
    Json values = Json::object();
    for (const Evaluation& run : runs) {
      const Json value = run.protocol.value(Json::json_pointer(pointer), Json());
      if (!value.is_null() || !condition.only_where_known) values[run.run] = value;
    }
    if (std::any_of(values.begin(), values.end(), [&](const Json& value) { return value != *values.begin(); }))
      result[condition.name] = values;
  }
  return result;
}

/// What differs, in lines below the table; empty when nothing does.
std::string difference_lines(const Json& differences) {
  if (differences.empty()) return "";
  std::string out = "\nThe runs were not evaluated in the same way, so their figures do not compare directly:\n\n";
  for (const auto& [condition, values] : differences.items()) {
    std::vector<std::string> parts;
    for (const auto& [run, value] : values.items())
      parts.push_back(run + " " +
                      (value.is_null()     ? "none"
                       : value.is_string() ? value.get<std::string>()
                                           : value.dump()));
    out += fmt::format("- {}: {}\n", condition, fmt::join(parts, "; "));
  }
  return out;
}

/// The rows by the name of the run, and the differences if there are any.
Json as_json(const std::vector<Evaluation>& runs, const Json& differences) {
  Json json;
  for (const Evaluation& run : runs) json[run.run] = run.methods;
  if (!differences.empty()) json["protocol_differences"] = differences;
  return json;
}

/// The runs by their names; by their paths where two have the same name.
std::vector<Evaluation> read_evaluations(const CompareArguments& arguments) {
  std::vector<Evaluation> runs;
  for (const std::string& path : arguments.runs) {
    const fs::path folder = folder_path(fs::absolute(path));
    std::string name = folder.filename().string();
    if (std::any_of(runs.begin(), runs.end(), [&](const Evaluation& run) { return run.run == name; })) name = path;
    runs.push_back(read_evaluation(folder, arguments.split));
    runs.back().run = name;
  }
  return runs;
}

int run(const CompareArguments& arguments, const CommonOptions& common) {
  const std::vector<std::string>& words = split_words();
  if (std::find(words.begin(), words.end(), arguments.split) == words.end())
    fail<UsageError>("--split: '{}' is not a split to compare; give one of train, validation and test",
                     arguments.split);
  const std::vector<Evaluation> runs = read_evaluations(arguments);
  const Json different = differences(runs, arguments.split);
  const std::string text =
      common.json ? as_json(runs, different).dump() + "\n" : markdown(runs) + difference_lines(different);
  std::printf("%s", text.c_str());
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
