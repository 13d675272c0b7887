// `doppel train` killed as a machine that loses power kills it, and started again with the same command.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <thread>

#include "doppel/core/as_size.h"
#include "doppel/train/metrics.h"
#include "support/same_run.h"
#include "support/temporary_folder.h"

namespace doppel::kill_train_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;

constexpr int kIterations = 60;

int run(const std::string& arguments) {
  return std::system((DOPPEL_PROGRAM " " + arguments + " >/dev/null 2>&1").c_str());
}

std::size_t steps_logged(const fs::path& run) {
  const fs::path file = run / "metrics.jsonl";
  return fs::exists(file) ? read_metrics(file).size() : 0;
}

/// Trains EGNet on `prepared` into `run`; kills it `delay` microseconds after its log shows `kill_at` steps (-1:
/// never).
/// @return the wait status
int train(const fs::path& prepared, const fs::path& run, int kill_at, int delay = 0) {
  const pid_t child = fork();
  if (child == 0) {
    if (!std::freopen("/dev/null", "w", stderr) || !std::freopen("/dev/null", "w", stdout)) _exit(126);
    execl(DOPPEL_PROGRAM, DOPPEL_PROGRAM, "train", DOPPEL_SOURCE_DIR "/configs/tiny/egnet.yaml", "--set",
          ("capture=" + prepared.string()).c_str(), "--set",
          ("train.iterations=" + std::to_string(kIterations)).c_str(), "--set", "train.log_every=1", "--set",
          "train.checkpoint_every=7", "--set", "train.mean_weights=0.9", "--out", run.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (kill_at >= 0 && steps_logged(run) >= as_size(kill_at)) {
      std::this_thread::sleep_for(std::chrono::microseconds(delay));
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return status;
}

TEST(TrainCommandRecovers, EgNetKilledAtFiveRandomStepsEqualsAnUnbrokenRun) {
  const TemporaryFolder folder;
  const fs::path prepared = folder / "prepared", unbroken = folder / "unbroken", broken = folder / "broken";
  ASSERT_EQ(run("synth --preset tiny --out " + (folder / "capture").string()), 0);
  ASSERT_EQ(run("prepare " + (folder / "capture").string() + " --out " + prepared.string()), 0);
  ASSERT_EQ(train(prepared, unbroken, -1), 0);

  const unsigned number = std::random_device()();  // each run of this test kills elsewhere
  SCOPED_TRACE("seed " + std::to_string(number));
  std::mt19937 random(number);
  std::vector<int> kills;
  for (int i = 0; i < 5; ++i) kills.push_back(std::uniform_int_distribution<int>(0, kIterations - 10)(random));
  std::sort(kills.begin(), kills.end());
  int killed = 0;
  for (int kill_at : kills) {
    const int status = train(prepared, broken, kill_at, std::uniform_int_distribution<int>(0, 8000)(random));
    killed += WIFSIGNALED(status);
  }
  EXPECT_GE(killed, 4) << "the run came to its end too early for this test to mean anything";
  ASSERT_EQ(train(prepared, broken, -1), 0);

  support::expect_same_run(unbroken, broken);
}

}  // namespace
}  // namespace doppel::kill_train_test
