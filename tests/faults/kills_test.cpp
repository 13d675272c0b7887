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

/// DOPPEL_KILLS, or a few.
int kills_wanted() {
  const char* wanted = std::getenv("DOPPEL_KILLS");
  return wanted ? std::atoi(wanted) : 6;
}

/// Kills one command until it was killed often enough. Each round begins with a new folder, and ends with a run that
/// nobody kills.
class Killing {
 public:
  Killing(const TinyWork& work, std::vector<std::string> words, unsigned seed)
      : out_(work.at("out")), words_(std::move(words)), random_(seed) {
    words_.push_back(out_.string());
    fs::remove_all(out_);
    const auto start = Clock::now();
    if (const Ending ending = run(words_); !ending.succeeded()) fail("unbroken: {}", ending.err);
    duration_ = Clock::now() - start;
    whole_ = state_of(out_);
  }

  void run_rounds(int kills) {
    while (killed_ < kills) {
      fs::remove_all(out_);
      bool finished = false;
      for (int i = 0; i < kKillsPerRound && !finished && killed_ < kills; ++i) finished = !kill_once();
      const Ending ending = run(words_);
      ASSERT_TRUE(ending.succeeded()) << "after " << killed_ << " kills: " << ending.err;
      const Files found = state_of(out_);
      ASSERT_EQ(difference(found, whole_), "") << "after " << killed_ << " kills";
      ++rounds_;
    }
  }
  int killed() const { return killed_; }
  int rounds() const { return rounds_; }

 private:
  /// @return whether the kill came before the end
  bool kill_once() {
    std::uniform_real_distribution<double> share(0.0, 1.0);
    Process process(words_);
    std::this_thread::sleep_for(duration_ * share(random_));
    process.send(SIGKILL);
    if (process.wait().signal != SIGKILL) return false;
    ++killed_;
    for (const auto& [name, content] : state_of(out_))
      EXPECT_TRUE(is_leftover(name) || !content.starts_with("damaged: ")) << name << ": " << content;
    return true;
  }

  fs::path out_;
  std::vector<std::string> words_;
  std::mt19937 random_;
  Clock::duration duration_{};
  Files whole_;
  int killed_ = 0, rounds_ = 0;
};

class Kills : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { work_ = new TinyWork; }
  static void TearDownTestSuite() {
    delete work_;
    work_ = nullptr;
  }
  /// @param words that end with `--out`
  void expect_nothing_lost(std::vector<std::string> words, int kills) {
    words.pop_back();
    const unsigned seed = std::random_device()();  // each run of this test kills elsewhere
    SCOPED_TRACE("seed " + std::to_string(seed));
    Killing killing(*work_, words, seed);
    killing.run_rounds(kills);
    std::cout << fmt::format("{}: {} kills, {} results equal to the unbroken one\n", words.front(), killing.killed(),
                             killing.rounds());
  }
  static TinyWork* work_;
};
TinyWork* Kills::work_ = nullptr;

TEST_F(Kills, OfATrainingLoseNothing) { expect_nothing_lost(work_->train("", 60, 7), kills_wanted()); }
TEST_F(Kills, OfAPreparationLoseNothing) { expect_nothing_lost(work_->prepare(""), std::max(3, kills_wanted() / 4)); }
TEST_F(Kills, OfATrackLoseNothing) { expect_nothing_lost(work_->track(""), std::max(3, kills_wanted() / 4)); }

}  // namespace
}  // namespace doppel::faults
