#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/train/profile.h"

namespace doppel {

/// What one line of `metrics.jsonl` tells: means over the steps since the line before.
struct MetricsRecord {
  struct Term {
    std::string name;
    double raw = 0.0, weighted = 0.0;
  };
  std::int64_t step = 0;       ///< steps done
  double seconds = 0.0;        ///< training time so far, over all sessions
  double learning_rate = 0.0;  ///< of the last step
  double loss = 0.0;           ///< sum of the weighted terms
  std::vector<Term> terms;
  double gradient_norm = 0.0;
  std::vector<std::pair<std::string, double>> milliseconds;  ///< per step, by part
  double memory_mb = 0.0;                                    ///< `private_megabytes()` when the line was written

  /// One line of JSON. Everything but `seconds`, `milliseconds` and `memory_mb` is the same in a resumed and an
  /// unbroken run.
  std::string to_line() const;
  static MetricsRecord from_json(const nlohmann::json& json);
};

/// Sums over steps until a line is due. Its state goes into checkpoints, so that the means of a resumed run are those
/// of an unbroken one.
class MetricsWindow {
 public:
  void add(const std::vector<MetricsRecord::Term>& terms, double gradient_norm, const Profile& profile);
  std::int64_t steps() const { return steps_; }
  /// Means of the window; then it is empty again.
  MetricsRecord take();

  std::string state() const;
  void restore(const std::string& state);

 private:
  std::int64_t steps_ = 0;
  std::vector<MetricsRecord::Term> sums_;
  double gradient_norm_ = 0.0;
  Profile profile_;
};

/// `metrics.jsonl`: appended line by line.
class MetricsFile {
 public:
  /// Keeps the lines up to `step` (a resumed run repeats the later ones) and drops the rest, also a half-written last
  /// line.
  MetricsFile(const std::filesystem::path& path, std::int64_t step);
  ~MetricsFile();
  MetricsFile(const MetricsFile&) = delete;
  MetricsFile& operator=(const MetricsFile&) = delete;
  void append(const MetricsRecord& record);

 private:
  std::filesystem::path path_;
  std::FILE* file_ = nullptr;
};

/// All readable lines, in order; a missing file reads as empty, damaged lines are skipped.
std::vector<MetricsRecord> read_metrics(const std::filesystem::path& path);

}  // namespace doppel
