#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace doppel {

/// Shows the progress of a long job on stderr. On a terminal it is a bar with the time left; elsewhere it is a plain
/// line every ten seconds and at the end. Use it from one thread only.
class Progress {
 public:
  /// @param total all steps of the job @param done the steps that a resumed job has already completed
  Progress(std::string title, std::int64_t total, std::int64_t done = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// @param note text behind the bar ("loss 0.031")
  void advance(std::int64_t steps = 1, const std::string& note = "");
  /// Takes steps from the total that turned out not to be needed.
  void drop(std::int64_t steps) { total_ -= steps; }
  /// Ends the bar. The destructor calls it too.
  void finish();

 private:
  void draw(bool last);
  std::string title_, note_;
  std::int64_t total_, done_, initial_;
  bool terminal_, finished_ = false;
  std::chrono::steady_clock::time_point start_, drawn_;
};

/// The position of the running job in a chain of jobs. While it is set, every Progress of the process shows it, and the
/// time that the whole chain still takes.
struct ProgressChain {
  std::string position;        ///< before the title: "[3/11]"
  double step_seconds = 0.0;   ///< what this job is expected to take
  double later_seconds = 0.0;  ///< what the jobs after it are expected to take
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();  ///< of this job
};
/// Sets the chain, or ends it with nothing. Not while a Progress lives.
void set_progress_chain(std::optional<ProgressChain> chain);

/// 95 -> "1:35", 4000 -> "1:06:40".
std::string format_duration(double seconds);

}  // namespace doppel
