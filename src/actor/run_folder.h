#pragma once

#include <filesystem>
#include <string>

#include "doppel/actor/checkpoint.h"

namespace doppel {

/// What to do when the folder already holds a run.
enum class RunMode {
  automatic,  ///< resume if the configuration is the same, else stop with an error
  resume,     ///< there must be something to resume
  overwrite   ///< begin anew
};

/// A run on disk: `config.yaml`, `checkpoints/`, `metrics.jsonl`, `events.out.tfevents.*`, `images/`, `report.html`,
/// `evaluation.json`.
class RunFolder {
 public:
  explicit RunFolder(std::filesystem::path path) : path_(std::move(path)) {}

  /// Makes the folder ready for a run of `config` (resolved YAML): finds out whether there is something to resume,
  /// refuses to mix two configurations, clears what an overwritten run left, writes config.yaml.
  /// @throws UsageError naming the keys that differ; Error when the folder holds other things
  void open(const std::string& config, RunMode mode) const;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path config() const { return path_ / "config.yaml"; }
  std::filesystem::path checkpoints() const { return path_ / "checkpoints"; }
  std::filesystem::path metrics() const { return path_ / "metrics.jsonl"; }
  std::filesystem::path images() const { return path_ / "pictures"; }
  std::filesystem::path report() const { return path_ / "report.html"; }
  std::filesystem::path evaluation() const { return path_ / "evaluation.json"; }

 private:
  void clear() const;
  std::filesystem::path path_;
};

/// The keys (dotted) in which two configurations differ, apart from those that cannot change the result: where the
/// capture lies, time limits, what is kept, how often images are drawn. Written "key: old -> new".
std::vector<std::string> config_differences(const std::string& old_yaml, const std::string& new_yaml);

}  // namespace doppel
