// One rank that sums a tensor again and again: distributed_driver RANK WORLD PORT DEAD_AFTER_MS SUMS [FAULT AT]
// FAULT happens before sum AT: kill or stop (by a signal), fail (an error of its own), or slow (it sleeps for twice the
// time after which a silent rank is dead). Prints the number of sums, or an error.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "doppel/core/error.h"
#include "support/rank_threads.h"

namespace {

void commit_fault(const std::string& fault, const doppel::RankOptions& options) {
  if (fault == "kill") std::raise(SIGKILL);
  if (fault == "stop") std::raise(SIGSTOP);
  if (fault == "fail") doppel::fail("the disk is full");
  if (fault == "slow") std::this_thread::sleep_for(2 * options.dead_after);
}

int run(doppel::Ranks& ranks, const doppel::RankOptions& options, int sums, const std::string& fault, int at) {
  int done = 0;
  try {
    for (; done < sums; ++done) {
      if (done == at) commit_fault(fault, options);
      const torch::Tensor value = torch::full({1000}, 1.0f + static_cast<float>(options.rank));
      ranks.sum(value);
      const float expected = 0.5f * static_cast<float>(options.world * (options.world + 1));
      if (!value.eq(expected).all().item<bool>()) doppel::fail("the sum is wrong");
    }
  } catch (const std::exception& e) {
    ranks.leave(e.what());
    throw;
  }
  std::printf("%d sums\n", done);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 6) return 2;
  doppel::RankOptions options = doppel::support::test_rank(std::atoi(argv[1]), std::atoi(argv[2]), std::atoi(argv[3]));
  options.dead_after = std::chrono::milliseconds(std::atoi(argv[4]));
  options.join_limit = std::chrono::seconds(4);
  try {
    doppel::Ranks ranks(options);
    return run(ranks, options, std::atoi(argv[5]), argc > 6 ? argv[6] : "", argc > 7 ? std::atoi(argv[7]) : -1);
  } catch (const std::exception& e) {
    std::printf("%s\n", e.what());
    return 1;
  }
}
