// What waiting threads of OpenMP cost: short parallel regions on two threads, beside busy threads.
//   for spins in 100 1000 3000 10000 30000; do GOMP_SPINCOUNT=$spins spin_bench BUSY_THREADS; done
// Prints the time of two threads as a share of the time of one thread, median and 90th percentile.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

namespace {

constexpr int kFrames = 400, kRegions = 3, kRegionSteps = 18'000, kSerialSteps = 9'000;

void compute(int steps) {
  volatile double x = 1.0;
  for (int i = 0; i < steps; ++i) x = x * 1.0000001;
}

/// Sorted times of frames of `kRegions` parallel regions, each followed by serial work.
std::vector<double> frame_times(int threads) {
  std::vector<double> times;
  for (int frame = 0; frame < kFrames; ++frame) {
    const auto begin = std::chrono::steady_clock::now();
    for (int region = 0; region < kRegions; ++region) {
#pragma omp parallel for num_threads(threads)
      for (int half = 0; half < 2; ++half) compute(kRegionSteps);
      compute(kSerialSteps);
    }
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }
  std::sort(times.begin(), times.end());
  return times;
}

}  // namespace

int main(int argc, char** argv) {
  std::atomic<bool> stop{false};
  std::vector<std::thread> busy;
  const std::vector<double> alone = frame_times(1);  // before there are busy threads
  for (int i = 0; i < (argc > 1 ? std::atoi(argv[1]) : 0); ++i)
    busy.emplace_back([&] {
      while (!stop) compute(1000);
    });
  const std::vector<double> times = frame_times(2);
  stop = true;
  for (std::thread& thread : busy) thread.join();
  const double one = alone[alone.size() / 2];
  std::printf("two threads: %.2f of one idle thread, 90th percentile %.2f (%.2f ms)\n", times[times.size() / 2] / one,
              times[times.size() * 9 / 10] / one, one);
}
