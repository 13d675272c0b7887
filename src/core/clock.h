#pragma once

#include <chrono>

namespace doppel {

/// The clock that measures durations.
using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace doppel
