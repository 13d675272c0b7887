#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <random>

#include "doppel/actor/checkpoint.h"
#include "support/same_run.h"
#include "support/temporary_folder.h"

namespace doppel::resume_test {

using support::TemporaryFolder;

namespace {

namespace fs = std::filesystem;

constexpr int kIterations = 60;

/// Runs the driver; kills it `delay` microseconds after it began step `kill_at` (-1: never). @return its wait status
int run_driver(const fs::path& run, int kill_at, int delay = 0) {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) ADD_FAILURE() << "pipe";
  const pid_t child = fork();
  if (child == 0) {
    dup2(pipe_ends[1], STDOUT_FILENO);
    close(pipe_ends[0]);
    close(pipe_ends[1]);
    execl(DOPPEL_RESUME_DRIVER, DOPPEL_RESUME_DRIVER, run.c_str(), std::to_string(kIterations).c_str(), nullptr);
    _exit(127);
  }
  close(pipe_ends[1]);
  std::FILE* lines = fdopen(pipe_ends[0], "r");
  char line[64];
  bool killed = false;
  while (std::fgets(line, sizeof(line), lines) != nullptr)
    if (kill_at >= 0 && !killed && std::atoi(line) >= kill_at) {
      usleep(static_cast<useconds_t>(delay));
      kill(child, SIGKILL);
      killed = true;
    }
  std::fclose(lines);
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST(ResumeRecovers, KilledAtFiveRandomStepsEqualsAnUnbrokenRun) {
  const TemporaryFolder folder;
  const fs::path unbroken = folder.path() / "unbroken", broken = folder.path() / "broken";
  ASSERT_EQ(run_driver(unbroken, -1), 0);

  std::random_device seed;  // each run of this test kills elsewhere; the seed is printed for a failure
  const unsigned number = seed();
  SCOPED_TRACE("seed " + std::to_string(number));
  std::mt19937 random(number);
  std::vector<int> kills;
  for (int i = 0; i < 5; ++i) kills.push_back(std::uniform_int_distribution<int>(0, kIterations - 2)(random));
  std::sort(kills.begin(), kills.end());
  for (int kill_at : kills) {
    const int status = run_driver(broken, kill_at, std::uniform_int_distribution<int>(0, 8000)(random));
    // It may have come to the end before the signal.
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
  }
  ASSERT_EQ(run_driver(broken, -1), 0);
  support::expect_same_run(unbroken, broken);
}

TEST(ResumeRecovers, DamagedNewestCheckpointFallsBackToAnOlderOne) {
  const TemporaryFolder folder;
  const fs::path unbroken = folder.path() / "unbroken", broken = folder.path() / "broken";
  ASSERT_EQ(run_driver(unbroken, -1), 0);
  run_driver(broken, 40);
  const auto steps = CheckpointFolder(broken / "checkpoints").steps();
  ASSERT_GE(steps.size(), 2u);
  const fs::path newest = CheckpointFolder(broken / "checkpoints").path(steps.back());
  fs::resize_file(newest, fs::file_size(newest) / 2);
  ASSERT_EQ(run_driver(broken, -1), 0);
  support::expect_same_run(unbroken, broken);
}

}  // namespace
}  // namespace doppel::resume_test
