#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

namespace doppel {

/// Threads that share the items of a list.
class Workers {
 public:
  /// @param count of threads, at least 1
  explicit Workers(int count);

  /// Calls work(worker, item) for each item, `count` items at a time and in the order of their numbers. Each worker
  /// has one item at a time. Ends early when the user asks to stop or a call throws; calls that run may use `wanted`.
  /// @param poll called by the thread that calls `share`, every tenth of a second and at the end
  /// @throws the first error of a call
  void share(std::size_t items, const std::function<void(std::size_t worker, std::size_t item)>& work,
             const std::function<void()>& poll = {});

  /// Whether work that takes long should go on: no other worker has failed, and the user did not ask to stop.
  bool wanted() const;
  int count() const { return count_; }

 private:
  int count_;
  std::atomic<bool> failed_{false};
};

}  // namespace doppel
