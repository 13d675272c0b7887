#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/core/appended_file.h"
#include "doppel/core/profile.h"

namespace doppel {

/// One line of `metrics.jsonl`: means over the steps since the last line.
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

/// Sums over the steps of a line. Checkpoints contain its state, so that the means of a resumed run equal those of an
/// unbroken run.
class MetricsWindow {
 public:
  void add(const std::vector<MetricsRecord::Term>& terms, double gradient_norm, const Profile& profile);
  std::int64_t steps() const { return steps_; }
  /// Returns the means and empties the sums.
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
  /// Keeps the lines up to `step` and drops the rest, also an incomplete last line; a resumed run writes later lines
  /// again.
  MetricsFile(const std::filesystem::path& path, std::int64_t step);
  /// A line that cannot be written now is written with the next one.
  void append(const MetricsRecord& record) { file_.append(record.to_line() + "\n"); }
  /// @throws Error when lines cannot be written
  void finish() { file_.finish(); }

 private:
  AppendedFile file_;
};

/// All readable lines, in order. A missing file gives no lines; damaged lines are skipped.
std::vector<MetricsRecord> read_metrics(const std::filesystem::path& path);

}  // namespace doppel
