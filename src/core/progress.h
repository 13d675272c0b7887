#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace doppel {

/// Shows how far a long job is, on stderr: a bar with the time left on a terminal, a plain line every ten seconds
/// elsewhere (and one at the end). Safe to call from one thread.
class Progress {
 public:
  /// @param total steps until the end; `done` counts those a resumed job need not do again
  Progress(std::string title, std::int64_t total, std::int64_t done = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `note` is shown behind the bar ("loss 0.031").
  void advance(std::int64_t steps = 1, const std::string& note = "");
  /// Ends the bar; the destructor does it too.
  void finish();

 private:
  void draw(bool last);
  std::string title_, note_;
  std::int64_t total_, done_, initial_;
  bool terminal_, finished_ = false;
  std::chrono::steady_clock::time_point start_, drawn_;
};

/// 95 -> "1:35", 4000 -> "1:06:40".
std::string format_duration(double seconds);

}  // namespace doppel
