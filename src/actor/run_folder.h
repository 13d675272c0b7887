#pragma once

#include <filesystem>
#include <string>

#include "doppel/actor/checkpoint.h"

namespace doppel {

/// What to do when the folder already contains a run.
enum class RunMode {
  automatic,  ///< resume if the configuration is the same, otherwise stop with an error
  resume,     ///< resume; without a checkpoint, stop with an error
  overwrite   ///< start again
};

/// The files of a run. They are `config.yaml`, `checkpoints/`, `metrics.jsonl`, `validation.jsonl`,
/// `events.out.tfevents.*`, `pictures/`, `report.html`, `evaluation.json`.
class RunFolder {
 public:
  explicit RunFolder(std::filesystem::path path) : path_(std::move(path)) {}

  /// Whether the folder can take a run of `config` (resolved YAML): it holds nothing else, a run that is to be resumed
  /// exists, and its configuration is the same. Changes nothing.
  /// @throws UsageError naming the keys that differ, or when the folder contains other files
  void check(const std::string& config, RunMode mode) const;
  /// Prepares the folder for a run of `config`: removes the files of an overwritten run, and writes config.yaml.
  /// @throws as `check`
  void open(const std::string& config, RunMode mode) const;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path config() const { return path_ / "config.yaml"; }
  std::filesystem::path checkpoints() const { return path_ / "checkpoints"; }
  std::filesystem::path metrics() const { return path_ / "metrics.jsonl"; }
  std::filesystem::path validation() const { return path_ / "validation.jsonl"; }
  std::filesystem::path images() const { return path_ / "pictures"; }
  std::filesystem::path report() const { return path_ / "report.html"; }
  std::filesystem::path evaluation() const { return path_ / "evaluation.json"; }

 private:
  void clear() const;
  std::filesystem::path path_;
};

/// The keys (dotted) in which two configurations differ, as "key: old -> new". Keys that cannot change the result are
/// left out: the path of the capture, time limits, which checkpoints are kept, how often images are drawn.
std::vector<std::string> config_differences(const std::string& old_yaml, const std::string& new_yaml);

}  // namespace doppel
