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

/// What a stage does when its queue is full.
enum class WhenFull {
  wait,         ///< waits until an item is taken: no item is dropped, and results do not depend on timing
  drop_oldest,  ///< drops the oldest item and continues: the consumer gets the newest items
};

/// One stage of a pipeline (4.7.3): produces items in order on its own thread, a few ahead of the consumer. When one
/// stage feeds another, the consumer must be destroyed first.
template <typename T>
class Prefetch {
 public:
  /// @param make produces the next item, or nothing at the end; called on one thread only
  /// @param ahead largest number of items in the queue
  Prefetch(std::function<std::optional<T>()> make, std::size_t ahead, WhenFull when_full = WhenFull::wait)
      : make_(std::move(make)), ahead_(ahead), when_full_(when_full), thread_([this] { work(); }) {}
  /// Waits for the item that is being produced.
  ~Prefetch() { finish(); }
  Prefetch(const Prefetch&) = delete;
  Prefetch& operator=(const Prefetch&) = delete;

  /// The next item, or nothing at the end. @throws the exception of `make`, after the items before it
  std::optional<T> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !made_.empty() || ended_; });
    return take(lock);
  }

  struct Arrival {
    std::optional<T> thing;
    bool ended = false;  ///< no more items will follow
  };
  /// Like `next`, but returns without an item after this time.
  Arrival next_within(double seconds) {
    std::unique_lock lock(mutex_);
    const auto there = [&] { return !made_.empty() || ended_; };
    if (!changed_.wait_for(lock, std::chrono::duration<double>(seconds), there)) return {};
    Arrival arrival{take(lock), false};
    arrival.ended = !arrival.thing;
    return arrival;
  }

  /// Stops production. Items in the queue can still be taken. The item that is being produced is dropped.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = ended_ = true;
    }
    changed_.notify_all();
  }
  /// Stops, and waits until `make` has returned.
  void finish() {
    stop();
    if (thread_.joinable()) thread_.join();
  }
  /// The number of items that were produced and dropped.
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
  /// @return false when production was stopped
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
  std::thread thread_;  ///< last, so that all other members exist when it begins
};

}  // namespace doppel
