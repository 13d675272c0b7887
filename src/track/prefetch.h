#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace doppel {

/// What a stage does that has made as much as it may keep.
enum class WhenFull {
  wait,         ///< until something is taken: none is dropped, and what comes out does not depend on who is fast
  drop_oldest,  ///< goes on, and what was made first is lost: whoever takes gets the newest
};

/// Makes things on a thread of its own, in order and a few ahead of whoever takes them: one stage of a pipeline
/// (4.7.3). Of two that feed each other, the one that takes must go first.
template <typename T>
class Prefetch {
 public:
  /// @param make the next thing, or nothing at the end; called on one thread only @param ahead made and not yet taken,
  /// at most
  Prefetch(std::function<std::optional<T>()> make, std::size_t ahead, WhenFull when_full = WhenFull::wait)
      : make_(std::move(make)), ahead_(ahead), when_full_(when_full), thread_([this] { work(); }) {}
  /// Waits for the thing that is being made.
  ~Prefetch() { finish(); }
  Prefetch(const Prefetch&) = delete;
  Prefetch& operator=(const Prefetch&) = delete;

  /// The next thing, or nothing at the end. @throws what `make` threw, in its place
  std::optional<T> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !made_.empty() || ended_; });
    return take(lock);
  }

  struct Arrival {
    std::optional<T> thing;
    bool ended = false;  ///< there will be no more
  };
  /// As `next`, but comes back without a thing when there is none after so many seconds.
  Arrival next_within(double seconds) {
    std::unique_lock lock(mutex_);
    const auto there = [&] { return !made_.empty() || ended_; };
    if (!changed_.wait_for(lock, std::chrono::duration<double>(seconds), there)) return {};
    Arrival arrival{take(lock), false};
    arrival.ended = !arrival.thing;
    return arrival;
  }

  /// Makes no more. What was made can still be taken, and then comes the end, even while the last thing is being made:
  /// that one is lost.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = ended_ = true;
    }
    changed_.notify_all();
  }
  /// Stops, and waits until `make` is no longer at work.
  void finish() {
    stop();
    if (thread_.joinable()) thread_.join();
  }
  /// How many were made and lost.
  long num_dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  std::optional<T> take(std::unique_lock<std::mutex>& lock) {
    if (made_.empty()) {
      if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
      return std::nullopt;
    }
    std::optional<T> result = std::move(made_.front());
    made_.pop_front();
    lock.unlock();
    changed_.notify_all();
    return result;
  }

  void work() {
    std::exception_ptr error;
    try {
      while (wait_for_room()) {
        std::optional<T> thing = make_();
        if (!thing) break;
        const std::lock_guard lock(mutex_);
        if (stopped_) {
          ++dropped_;
          break;
        }
        if (made_.size() == ahead_) {
          made_.pop_front();
          ++dropped_;
        }
        made_.push_back(std::move(*thing));
        changed_.notify_all();
      }
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    error_ = error;
    ended_ = true;
    changed_.notify_all();
  }
  /// @return false when nobody wants more
  bool wait_for_room() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return stopped_ || made_.size() < ahead_ || when_full_ == WhenFull::drop_oldest; });
    return !stopped_;
  }

  std::function<std::optional<T>()> make_;
  std::size_t ahead_;
  WhenFull when_full_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> made_;
  long dropped_ = 0;
  bool stopped_ = false, ended_ = false;
  std::exception_ptr error_;
  std::thread thread_;  ///< last, so that all else is there when it begins
};

}  // namespace doppel
