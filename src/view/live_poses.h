#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

namespace doppel {

/// The poses that a tracker sends while it tracks. Readers ask for the newest one: a slow reader leaves poses out, and
/// nothing waits for it. All functions may be called from any thread.
class LivePoses {
 public:
  struct Latest {
    std::uint32_t number = 0;              ///< of the newest pose, from 1
    bool tracked = false;                  ///< whether the person is seen
    std::vector<std::vector<float>> rows;  ///< the newest poses [rows][D], oldest first
  };

  /// @param rows how many poses are remembered, at least 1
  explicit LivePoses(std::size_t rows) : most_rows_(rows) {}

  /// Takes the next pose [D]. A pose after a break (kLiveBreak) begins a new window.
  void push(std::vector<float> dofs, bool tracked);
  /// Waits at most `patience` for a pose after number `after`. A pose older than kLiveBreak does not count.
  std::optional<Latest> newer_than(std::uint32_t after, std::chrono::milliseconds patience);
  /// Ends all waiting, for good.
  void close();

 private:
  using Clock = std::chrono::steady_clock;

  const std::size_t most_rows_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::vector<float>> rows_;
  std::uint32_t number_ = 0;
  bool tracked_ = false, closed_ = false;
  Clock::time_point when_;
};

/// After this time without a pose, nothing is live.
constexpr std::chrono::milliseconds kLiveBreak{2000};

}  // namespace doppel
