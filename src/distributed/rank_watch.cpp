#include "doppel/distributed/rank_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "doppel/distributed/c10d_link.h"

namespace doppel {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// Signs of life in the time after which a rank without one is dead.
constexpr int kBeats = 15;
/// After a connection broke, this share of that time is enough.
constexpr int kSuspicion = 3;
/// Rounds of the watch for which a rank that ends waits for the others to learn the reason.
constexpr int kFarewell = 4;

std::string seconds(Clock::duration time) {
  return fmt::format("{:.0f} s", std::chrono::duration<double>(time).count());
}

}  // namespace

struct RankWatch::State {
  State(const RankOptions& chosen, std::vector<std::string> all) : options(chosen), names(std::move(all)) {}

  const RankOptions options;
  const std::vector<std::string> names;
  std::mutex mutex;
  std::condition_variable changed;
  bool stopping = false, ended = false, suspicious = false, answered = true;
  std::optional<std::string> verdict, reason;
  bool told = false;
  std::int64_t readers = 0;  ///< ranks that know the first reason
  Clock::time_point last_round = Clock::now();
  std::optional<Clock::time_point> overdue_since;

  milliseconds interval() const { return std::max(options.dead_after / kBeats, milliseconds(20)); }

  void run() {
    try {
      NoteBoard board(options.host, options.port, false, options.attempt, options.join_limit);
      watch(board);
    } catch (const std::exception&) {
      std::lock_guard lock(mutex);
      if (!verdict)
        verdict = options.keeps_notes ? fmt::format("{} has ended: the connection to it broke", names[0])
                                      : std::string("the launcher, which keeps the notes of the ranks, has ended");
    }
    std::lock_guard lock(mutex);
    ended = true;
    changed.notify_all();
  }

  void watch(NoteBoard& board) {
    const int world = options.world;
    std::vector<std::int64_t> beats(static_cast<std::size_t>(world), -1);
    std::vector<Clock::time_point> seen(static_cast<std::size_t>(world), Clock::now());
    bool knows = false;
    while (true) {
      board.add(fmt::format("beat/{}", options.rank), 1);
      publish(board);
      if (!knows && board.has("reason/1")) {
        knows = true;
        board.add("readers", 1);
        const std::string text = board.read("reason/1");
        std::lock_guard lock(mutex);
        verdict = text;
      }
      for (int i = 0; i < world; ++i) {
        const std::int64_t beat = board.add(fmt::format("beat/{}", i), 0);
        const auto k = static_cast<std::size_t>(i);
        if (beat != beats[k]) seen[k] = Clock::now();
        beats[k] = beat;
      }
      const std::int64_t know = board.add("readers", 0);
      std::unique_lock lock(mutex);
      readers = know;
      last_round = Clock::now();
      judge(seen);
      changed.notify_all();
      changed.wait_for(lock, interval(), [this] { return stopping || (reason && !told); });
      if (stopping) return;
    }
  }

  /// Writes the reason for which this rank ends, or what it found out, for the others.
  void publish(NoteBoard& board) {
    std::optional<std::string> text;
    {
      std::lock_guard lock(mutex);
      if (told || !reason) return;
      text = reason;
    }
    board.write(fmt::format("reason/{}", board.add("reasons", 1)), *text);
    std::lock_guard lock(mutex);
    told = true;
  }

  void judge(const std::vector<Clock::time_point>& seen) {
    if (verdict) return;
    const Clock::duration limit = options.dead_after / (suspicious ? kSuspicion : 1);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Clock::duration silent = Clock::now() - seen[i];
      if (silent < limit || static_cast<int>(i) == options.rank) continue;
      verdict =
          fmt::format("{} has given no sign of life for {}: it was killed or stopped, or the network to it is cut",
                      names[i], seconds(silent));
      if (!reason) reason = verdict;
      return;
    }
  }

  /// Whether the keeper of the notes has not answered for too long. Two looks an interval apart, because this process
  /// itself may have been stopped in between.
  bool keeper_is_silent() {
    if (ended || Clock::now() - last_round < options.dead_after / (suspicious ? kSuspicion : 1)) {
      overdue_since.reset();
      return false;
    }
    if (!overdue_since) overdue_since = Clock::now();
    return Clock::now() - *overdue_since > 2 * interval();
  }
};

RankWatch::RankWatch(const RankOptions& options, std::vector<std::string> names)
    : state_(std::make_shared<State>(options, std::move(names))) {
  std::thread([state = state_] { state->run(); }).detach();
}

RankWatch::~RankWatch() {
  std::unique_lock lock(state_->mutex);
  state_->stopping = true;
  state_->changed.notify_all();
  state_->changed.wait_for(lock, 2 * state_->interval(), [this] { return state_->ended; });
}

milliseconds RankWatch::interval() const { return state_->interval(); }

std::optional<std::string> RankWatch::verdict() {
  std::lock_guard lock(state_->mutex);
  if (!state_->verdict && state_->keeper_is_silent())
    state_->verdict = fmt::format(
        "{}, which keeps the notes of the ranks, has not answered for {}: it was stopped, or "
        "the network to it is cut",
        state_->names[0], seconds(Clock::now() - state_->last_round));
  return state_->verdict;
}

std::string RankWatch::explain_broken_connection(const std::string& what_broke) {
  const Clock::time_point end = Clock::now() + state_->options.dead_after;
  {
    std::lock_guard lock(state_->mutex);
    state_->suspicious = true;
  }
  while (Clock::now() < end) {
    if (const auto found = verdict()) return *found;
    std::this_thread::sleep_for(interval() / 4);
  }
  return fmt::format("the connection to another rank broke, and all ranks give signs of life: {}", what_broke);
}

void RankWatch::tell(const std::string& reason) {
  std::unique_lock lock(state_->mutex);
  if (!state_->reason) state_->reason = reason;
  state_->changed.notify_all();
  // Rank 0 keeps the notes, so it must live until the others have read them.
  state_->changed.wait_for(lock, kFarewell * state_->interval(), [this] {
    return state_->ended || (state_->told && (state_->options.rank != 0 || state_->readers >= state_->options.world));
  });
}

}  // namespace doppel
