// Commands killed at random moments, as a machine that loses power kills them, and started again.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "doppel/core/error.h"
#include "faults/folder_state.h"
#include "faults/program_run.h"
#include "faults/tiny_work.h"

namespace doppel::faults {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kKillsPerRound = 10;  ///< then the command may come to its end

/// Of each command: DOPPEL_KILLS, or a few.
int kills_wanted() {
  const char* wanted = std::getenv("DOPPEL_KILLS");
  return wanted ? std::atoi(wanted) : 4;
}

/// Kills one command until it was killed often enough. Each round begins with the folder as it was before the command,
/// and ends with a run that nobody kills, unless a kill came after the last file. (`synth` refuses a complete folder.)
class Killing {
 public:
  Killing(const TinyWork& work, Recipe recipe, unsigned seed)
      : work_(work), recipe_(std::move(recipe)), out_(work.at("out")), words_(recipe_.with_out(out_)), random_(seed) {
    work_.restore(recipe_, out_);
    const auto start = Clock::now();
    if (const Ending ending = run(words_); !ending.succeeded()) fail("unbroken: {}", ending.err);
    duration_ = Clock::now() - start;
    whole_ = state_of(out_);
  }

  void run_rounds(int kills) {
    while (killed_ < kills) {
      work_.restore(recipe_, out_);
      bool finished = false;
      for (int i = 0; i < kKillsPerRound && !finished && killed_ < kills; ++i) {
        finished = !kill_once();
        if (recipe_.into_empty && !finished) work_.restore(recipe_, out_);
      }
      if (!finished) {
        const Ending ending = run(words_);
        ASSERT_TRUE(ending.succeeded()) << "after " << killed_ << " kills: " << ending.err;
      }
      const Files found = state_of(out_);
      ASSERT_EQ(difference(found, whole_), "") << "after " << killed_ << " kills";
      ++rounds_;
    }
  }
  int killed() const { return killed_; }
  int rounds() const { return rounds_; }

 private:
  /// @return whether the kill came before all files were there; a command that ends before it ends well
  bool kill_once() {
    std::uniform_real_distribution<double> share(0.0, 1.0);
    Process process(words_);
    std::this_thread::sleep_for(duration_ * share(random_));
    process.send(SIGKILL);
    if (const Ending ending = process.wait(); ending.signal != SIGKILL) {
      EXPECT_TRUE(ending.succeeded()) << "after " << killed_ << " kills: " << ending.err;
      return false;
    }
    ++killed_;
    const Files found = state_of(out_);
    for (const auto& [name, content] : found)
      EXPECT_TRUE(is_leftover(name) || !content.starts_with("damaged: ")) << name << ": " << content;
    return !difference(found, whole_).empty();
  }

  const TinyWork& work_;
  Recipe recipe_;
  fs::path out_;
  std::vector<std::string> words_;
  std::mt19937 random_;
  Clock::duration duration_{};
  Files whole_;
  int killed_ = 0, rounds_ = 0;
};

TEST(Kills, LoseNothing) {
  const TinyWork work;
  int kills = 0;
  for (const Recipe& recipe : work.recipes_to_kill()) {
    if (!is_wanted(recipe, "prepare,long train,track")) continue;
    const unsigned seed = std::random_device()();  // each run of this test kills elsewhere
    SCOPED_TRACE(recipe.name + ", seed " + std::to_string(seed));
    Killing killing(work, recipe, seed);
    killing.run_rounds(kills_wanted());
    std::cout << fmt::format("{}: {} kills, {} results equal to the unbroken one\n", recipe.name, killing.killed(),
                             killing.rounds())
              << std::flush;
    kills += killing.killed();
  }
  EXPECT_GT(kills, 0);
}

}  // namespace
}  // namespace doppel::faults
