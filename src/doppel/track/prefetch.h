#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace doppel {

/// Makes things on a thread of its own, in order and a few ahead of whoever takes them: one stage of a pipeline
/// (4.7.3). None is dropped, so what comes out does not depend on how fast either side is.
template <typename T>
class Prefetch {
 public:
  /// @param make the next thing, or nothing at the end; called on one thread only @param ahead made and not yet taken,
  /// at most
  Prefetch(std::function<std::optional<T>()> make, std::size_t ahead)
      : make_(std::move(make)), ahead_(ahead), thread_([this] { work(); }) {}
  /// Waits for the thing that is being made.
  ~Prefetch() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  Prefetch(const Prefetch&) = delete;
  Prefetch& operator=(const Prefetch&) = delete;

  /// The next thing, or nothing at the end. @throws what `make` threw, in its place
  std::optional<T> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !made_.empty() || ended_; });
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

 private:
  void work() {
    std::exception_ptr error;
    try {
      while (wait_for_room()) {
        std::optional<T> thing = make_();
        if (!thing) break;
        const std::lock_guard lock(mutex_);
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
    changed_.wait(lock, [&] { return stopped_ || made_.size() < ahead_; });
    return !stopped_;
  }

  std::function<std::optional<T>()> make_;
  std::size_t ahead_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> made_;
  bool stopped_ = false, ended_ = false;
  std::exception_ptr error_;
  std::thread thread_;  ///< last, so that all else is there when it begins
};

}  // namespace doppel
