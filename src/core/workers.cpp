#include "doppel/core/workers.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "doppel/core/process.h"

namespace doppel {

namespace {

constexpr std::chrono::milliseconds kPollInterval{100};

}  // namespace

Workers::Workers(int count) : count_(std::max(1, count)) {}

bool Workers::wanted() const { return !failed_ && !stop_requested(); }

void Workers::share(std::size_t items, const std::function<void(std::size_t, std::size_t)>& work,
                    const std::function<void()>& poll) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr error;
  std::size_t running = std::min(items, static_cast<std::size_t>(count_));
  std::mutex mutex;  // of both
  std::condition_variable ended;
  std::vector<std::thread> threads;
  for (std::size_t worker = 0, workers = running; worker < workers; ++worker)
    threads.emplace_back([&, worker] {
      try {
        for (std::size_t item = next++; item < items && wanted(); item = next++) work(worker, item);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!error) error = std::current_exception();
        failed_ = true;
      }
      const std::lock_guard lock(mutex);
      --running;
      ended.notify_one();
    });
  for (bool done = !poll; !done;) {
    {
      std::unique_lock lock(mutex);
      done = ended.wait_for(lock, kPollInterval, [&] { return running == 0; });
    }
    poll();
  }
  for (std::thread& thread : threads) thread.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace doppel
