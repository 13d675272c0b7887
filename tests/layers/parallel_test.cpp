#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>

namespace doppel::parallel_test {
namespace {

/// Counts who has arrived; `meet` is true once `expected` are there at the same time.
class MeetingPoint {
 public:
  explicit MeetingPoint(int expected) : missing_(expected) {}
  bool meet(std::chrono::seconds patience) {
    std::unique_lock<std::mutex> lock(mutex_);
    --missing_;
    changed_.notify_all();
    return changed_.wait_for(lock, patience, [this] { return missing_ <= 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int missing_;
};

// Without OpenMP's flags at::parallel_for compiles to a plain loop: everything stays right and takes twice as long.
TEST(ParallelReference, TwoThreadsWorkAtTheSameTime) {
  const int threads = at::get_num_threads();
  at::set_num_threads(2);
  MeetingPoint point(2);
  std::atomic<int> chunks{0}, met{0};
  at::parallel_for(0, 2, 1, [&](int64_t, int64_t) {
    ++chunks;
    met += point.meet(std::chrono::seconds(20));
  });
  at::set_num_threads(threads);
  EXPECT_EQ(chunks, 2) << "two items with a grain of 1 came as one piece: this file was compiled without OpenMP";
  EXPECT_EQ(met, 2) << "the two pieces ran one after the other";
}

}  // namespace
}  // namespace doppel::parallel_test
