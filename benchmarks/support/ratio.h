#pragma once

/// Times several ways of doing the same work against each other, honestly on a shared machine: the candidates take
/// turns within one run, medians are compared, and what is quoted is the ratio.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

namespace doppel::bench {

struct Candidate {
  std::string name;
  std::function<void()> run;
};

struct RatioOptions {
  int warm_up = 3;                ///< turns that are not counted
  int turns = 25;                 ///< counted turns of every candidate
  double minimum_slice_ms = 2.0;  ///< a turn repeats its candidate until it has taken this long
};

struct Timing {
  std::string name;
  double median_ms = 0.0, best_ms = 0.0;
};

/// Milliseconds per call over one turn.
inline double time_turn(const std::function<void()>& run, double minimum_slice_ms) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  double elapsed = 0.0;
  int calls = 0;
  do {
    run();
    ++calls;
    elapsed = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  } while (elapsed < minimum_slice_ms);
  return elapsed / calls;
}

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

/// Runs the candidates in turns and prints a table: median, best, and the median relative to that of the LAST
/// candidate, which by convention is ours. The ratio is the median over turns of the ratios within one turn, so that a
/// disturbance that lasts longer than a turn hits both sides.
inline std::vector<Timing> compare(const std::string& title, const std::vector<Candidate>& candidates,
                                   const RatioOptions& options = {}) {
  std::vector<std::vector<double>> times(candidates.size());
  for (int turn = -options.warm_up; turn < options.turns; ++turn) {
    for (size_t c = 0; c < candidates.size(); ++c) {
      const double ms = time_turn(candidates[c].run, options.minimum_slice_ms);
      if (turn >= 0) times[c].push_back(ms);
    }
  }
  std::printf("%s\n  %-34s %10s %10s %9s\n", title.c_str(), "", "median ms", "best ms", "ratio");
  std::vector<Timing> result;
  for (size_t c = 0; c < candidates.size(); ++c) {
    std::vector<double> ratios;
    for (size_t turn = 0; turn < times[c].size(); ++turn) ratios.push_back(times[c][turn] / times.back()[turn]);
    result.push_back({candidates[c].name, median(times[c]), *std::min_element(times[c].begin(), times[c].end())});
    std::printf("  %-34s %10.3f %10.3f %9.2f\n", candidates[c].name.c_str(), result.back().median_ms,
                result.back().best_ms, median(ratios));
  }
  std::fflush(stdout);
  return result;
}

}  // namespace doppel::bench
