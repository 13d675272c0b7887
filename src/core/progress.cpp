#include "doppel/core/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr int kBarWidth = 24;
constexpr double kTerminalInterval = 0.1, kPlainInterval = 10.0;  // seconds between two drawings

double seconds_between(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

std::optional<ProgressChain>& progress_chain() {
  static std::optional<ProgressChain> chain;
  return chain;
}

}  // namespace

void set_progress_chain(std::optional<ProgressChain> chain) { progress_chain() = std::move(chain); }

std::string format_duration(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::llround(std::max(0.0, seconds)));
  const std::int64_t hours = whole / 3600, minutes = whole / 60 % 60;
  return hours ? fmt::format("{}:{:02}:{:02}", hours, minutes, whole % 60)
               : fmt::format("{}:{:02}", minutes, whole % 60);
}

Progress::Progress(std::string title, std::int64_t total, std::int64_t done)
    : title_(std::move(title)),
      total_(total),
      done_(done),
      initial_(done),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()),
      drawn_(start_) {
  if (terminal_) draw(false);
}

Progress::~Progress() { finish(); }

void Progress::advance(std::int64_t steps, const std::string& note) {
  done_ += steps;
  note_ = note;
  const double idle = seconds_between(drawn_, std::chrono::steady_clock::now());
  if (!finished_ && idle >= (terminal_ ? kTerminalInterval : kPlainInterval)) draw(false);
}

void Progress::finish() {
  if (finished_) return;
  finished_ = true;
  draw(true);
}

void Progress::draw(bool last) {
  drawn_ = std::chrono::steady_clock::now();
  const double elapsed = seconds_between(start_, drawn_);
  const double share =
      total_ > 0 ? std::clamp(static_cast<double>(done_) / static_cast<double>(total_), 0.0, 1.0) : 1.0;

  // Steps of an earlier run took no time in this run, so they do not count for the speed.
  std::string time;
  double left = 0.0;  // 0: not known
  if (last) {
    time = "in " + format_duration(elapsed);
  } else if (done_ > initial_ && done_ < total_) {
    left = elapsed * static_cast<double>(total_ - done_) / static_cast<double>(done_ - initial_);
    time = format_duration(left) + " left";
  }

  const std::optional<ProgressChain>& chain = progress_chain();
  std::string line = chain ? chain->position + " " + title_ : title_;
  if (terminal_) {
    const auto filled = as_size(share * kBarWidth);
    line += " [" + std::string(filled, '=') + std::string(kBarWidth - filled, ' ') + "]";
  }
  line += fmt::format(" {}/{} {:.0f}%", done_, total_, 100.0 * share);
  if (!time.empty()) line += " " + time;
  if (!note_.empty()) line += "  " + note_;
  if (chain) {
    const double planned = chain->step_seconds - seconds_between(chain->begin, drawn_);
    line += "  (whole chain: about " + format_duration(std::max(left, planned) + chain->later_seconds) + " left)";
  }

  if (terminal_) {
    fmt::print(stderr, "\r\x1b[K{}{}", line, last ? "\n" : "");
  } else {
    fmt::print(stderr, "{}\n", line);
  }
  std::fflush(stderr);
}

}  // namespace doppel
