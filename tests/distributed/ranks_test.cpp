#include "doppel/distributed/ranks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdio>
#include <map>

#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/rank_threads.h"

namespace doppel::ranks_test {
namespace {

using support::free_port;
using support::message_of;
using support::on_ranks;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// ---- where a rank is ----

RankOptions read(const std::map<std::string, std::string>& variables, const RankFlags& flags = {}) {
  return read_rank_options(flags, [&](const char* name) {
    const auto found = variables.find(name);
    return found == variables.end() ? std::nullopt : std::optional<std::string>(found->second);
  });
}

TEST(RankOptionsReference, OneRankIsTheDefault) {
  EXPECT_EQ(read({}).world, 1);
  EXPECT_EQ(read({{"RANK", "0"}, {"WORLD_SIZE", "1"}}).world, 1);
  EXPECT_EQ(read({{"SLURM_NTASKS", "8"}}).world, 1) << "a shell of salloc is no task";
}

TEST(RankOptionsReference, LaunchersAreUnderstood) {
  for (const auto& [rank, world] :
       {std::pair("RANK", "WORLD_SIZE"), std::pair("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
        std::pair("SLURM_PROCID", "SLURM_NTASKS")}) {
    const RankOptions options = read({{rank, "2"}, {world, "4"}, {"MASTER_ADDR", "anna"}, {"MASTER_PORT", "1234"}});
    EXPECT_EQ(options.rank, 2);
    EXPECT_EQ(options.world, 4);
    EXPECT_EQ(options.host, "anna");
    EXPECT_EQ(options.port, 1234);
    EXPECT_TRUE(options.keeps_notes);
  }
  const RankOptions elastic = read({{"RANK", "0"},
                                    {"WORLD_SIZE", "2"},
                                    {"MASTER_ADDR", "anna"},
                                    {"TORCHELASTIC_USE_AGENT_STORE", "True"},
                                    {"TORCHELASTIC_RESTART_COUNT", "3"}});
  EXPECT_FALSE(elastic.keeps_notes);
  EXPECT_EQ(elastic.attempt, "3");
}

TEST(RankOptionsReference, FlagsComeBeforeVariables) {
  const RankOptions options = read({{"RANK", "5"}, {"WORLD_SIZE", "6"}}, {"10.0.0.1:99", 1, 2});
  EXPECT_EQ(options.rank, 1);
  EXPECT_EQ(options.world, 2);
  EXPECT_EQ(options.host, "10.0.0.1");
  EXPECT_EQ(options.port, 99);
  EXPECT_EQ(read({{"RANK", "5"}, {"WORLD_SIZE", "6"}}, {"", 0, 1}).world, 1);
}

TEST(RankOptionsRejects, WhatCannotBe) {
  const auto complaint = [](const std::map<std::string, std::string>& variables, const RankFlags& flags = {}) {
    return message_of([&] { read(variables, flags); });
  };
  EXPECT_THAT(complaint({{"RANK", "2"}, {"WORLD_SIZE", "2"}}),
              AllOf(HasSubstr("RANK is 2"), HasSubstr("last one is 1")));
  EXPECT_THAT(complaint({{"RANK", "x"}, {"WORLD_SIZE", "2"}}), HasSubstr("RANK is `x`"));
  EXPECT_THAT(complaint({{"RANK", "0"}, {"WORLD_SIZE", "2"}}), HasSubstr("MASTER_ADDR is not set"));
  EXPECT_THAT(complaint({{"RANK", "0"}, {"WORLD_SIZE", "2"}, {"MASTER_ADDR", "a"}, {"MASTER_PORT", "70000"}}),
              HasSubstr("MASTER_PORT is `70000`"));
  EXPECT_THAT(complaint({}, {"anna", 0, 2}), HasSubstr("HOST:PORT"));
  EXPECT_THAT(complaint({}, {"anna:1", std::nullopt, 2}), HasSubstr("together"));
  EXPECT_THAT(complaint({}, {"anna:1", 2, 2}), HasSubstr("--rank is 2"));
}

// ---- shares of a batch ----

TEST(BatchShareReference, RowsOfAllRanksAreTheBatch) {
  for (const std::int64_t whole : {1, 4, 7, 12})
    for (int world = 1; world <= whole; ++world) {
      std::int64_t next = 0;
      for (int rank = 0; rank < world; ++rank) {
        const BatchShare share = BatchShare::of(rank, world, whole);
        EXPECT_EQ(share.first, next);
        EXPECT_GE(share.count, whole / world);
        EXPECT_LE(share.count, whole / world + 1);
        next += share.count;
      }
      EXPECT_EQ(next, whole);
    }
}

// ---- exchanges ----

TEST(RanksReference, SumsAndTextsReachAllRanks) {
  for (const int world : {1, 2, 3}) {
    const auto errors = on_ranks(world, [&](Ranks& ranks) {
      const torch::Tensor value = torch::full({5}, static_cast<double>(ranks.rank() + 1), torch::kFloat64);
      ranks.sum(value);
      EXPECT_TRUE(value.eq(world * (world + 1) / 2).all().item<bool>());
      EXPECT_EQ(ranks.broadcast("rank " + std::to_string(ranks.rank())), "rank 0");
      EXPECT_EQ(ranks.broadcast(std::string()), "");
      const torch::Tensor in_background = torch::ones({100000});
      const auto wait = ranks.begin_sum(in_background);
      ranks.check_same("the weather", "sunny");
      wait();
      EXPECT_TRUE(in_background.eq(world).all().item<bool>());
    });
    EXPECT_THAT(errors, Each(IsEmpty()));
  }
}

TEST(RanksRejects, DifferentTexts) {
  const auto errors = on_ranks(2, [](Ranks& ranks) {
    ranks.check_same("the configuration", ranks.is_first() ? "seed: 1\nrate: 2\n" : "seed: 1\nrate: 3\n");
    ranks.sum(torch::ones({1}));
  });
  EXPECT_THAT(errors[1], AllOf(HasSubstr("the configuration of rank 1"), HasSubstr("here `rate: 3`, there `rate: 2`")));
  EXPECT_THAT(errors[0], AllOf(HasSubstr("rank 1 ("), HasSubstr("has ended: the configuration of rank 1")));
}

// ---- faults, with processes ----

/// A rank as a process, whose output is read at the end.
class Process {
 public:
  Process(int rank, int world, int port, int dead_after, int sums, const std::string& fault = "", int at = -1) {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("pipe");
    child_ = fork();
    if (child_ == 0) {
      dup2(ends[1], STDOUT_FILENO);
      close(ends[0]);
      close(ends[1]);
      const auto text = [](int value) { return std::to_string(value); };
      execl(DOPPEL_RANK_DRIVER, DOPPEL_RANK_DRIVER, text(rank).c_str(), text(world).c_str(), text(port).c_str(),
            text(dead_after).c_str(), text(sums).c_str(), fault.c_str(), text(at).c_str(), nullptr);
      _exit(127);
    }
    close(ends[1]);
    output_ = fdopen(ends[0], "r");
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process() {
    if (!done_) end(SIGKILL);
    std::fclose(output_);
  }

  /// @return what it printed; its status is in `status`
  std::string finish() {
    std::string text;
    char part[256];
    while (std::fgets(part, sizeof(part), output_)) text += part;
    end(0);
    return text;
  }
  void end(int signal) {
    if (signal) kill(child_, signal);
    waitpid(child_, &status, 0);
    done_ = true;
  }
  int status = 0;

 private:
  pid_t child_ = 0;
  bool done_ = false;
  std::FILE* output_ = nullptr;
};

TEST(RanksEnd, WhenOneIsKilled) {
  const int port = free_port();
  Process first(0, 3, port, 1500, 1000000), killed(1, 3, port, 1500, 1000000, "kill", 20),
      last(2, 3, port, 1500, 1000000);
  for (Process* rank : {&first, &last}) {
    EXPECT_THAT(rank->finish(), AllOf(HasSubstr("rank 1 (process "), HasSubstr("no sign of life")));
    EXPECT_EQ(WEXITSTATUS(rank->status), 1);
  }
}

TEST(RanksEnd, WhenOneIsStopped) {
  const int port = free_port();
  Process first(0, 2, port, 1500, 1000000), stopped(1, 2, port, 1500, 1000000, "stop", 20);
  EXPECT_THAT(first.finish(), AllOf(HasSubstr("rank 1 (process "), HasSubstr("no sign of life")));
}

TEST(RanksEnd, WhenRankZeroIsStoppedOrKilled) {
  for (const std::string fault : {"stop", "kill"}) {
    const int port = free_port();
    Process first(0, 2, port, 1500, 1000000, fault, 20), second(1, 2, port, 1500, 1000000);
    EXPECT_THAT(second.finish(),
                AllOf(HasSubstr("rank 0"), ::testing::AnyOf(HasSubstr("not answered"), HasSubstr("has ended"))))
        << fault;
  }
}

TEST(RanksEnd, WithTheReasonOfTheOneThatFailed) {
  for (const int failing : {0, 1}) {
    const int port = free_port();
    const auto fault = [&](int rank) { return rank == failing ? "fail" : ""; };
    Process first(0, 2, port, 3000, 1000000, fault(0), 20), second(1, 2, port, 3000, 1000000, fault(1), 20);
    Process& other = failing == 0 ? second : first;
    EXPECT_THAT(other.finish(), AllOf(HasSubstr("rank " + std::to_string(failing) + " (process "),
                                      HasSubstr("has ended: the disk is full")));
  }
}

TEST(RanksWait, ForASlowRank) {
  const int port = free_port();
  Process first(0, 2, port, 700, 50), slow(1, 2, port, 700, 50, "slow", 20);
  EXPECT_EQ(first.finish(), "50 sums\n");
  EXPECT_EQ(slow.finish(), "50 sums\n");
}

TEST(RanksReject, APortInUse) {
  const int port = free_port(), listener = socket(AF_INET6, SOCK_STREAM, 0);
  sockaddr_in6 address{};
  address.sin6_family = AF_INET6;
  address.sin6_addr = in6addr_any;
  address.sin6_port = htons(static_cast<std::uint16_t>(port));
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(listener, 1), 0);
  EXPECT_THAT(message_of([&] { Ranks ranks(support::test_rank(0, 2, port)); }),
              AllOf(HasSubstr("cannot open port " + std::to_string(port)), HasSubstr("it is in use")));
  close(listener);
}

TEST(RanksReject, AnotherNumberOfRanks) {
  const int port = free_port();
  Process first(0, 2, port, 1500, 10), second(1, 3, port, 1500, 10);
  EXPECT_THAT(second.finish(), HasSubstr("rank 1 was started as one of 3 ranks, rank 0 as one of 2"));
  EXPECT_THAT(first.finish(), HasSubstr("another rank could not begin: rank 1 was started as one of 3"));
}

TEST(RanksReject, TheSameRankTwice) {
  const int port = free_port();
  Process first(0, 3, port, 1500, 10), second(1, 3, port, 1500, 10), again(1, 3, port, 1500, 10);
  const std::string both = second.finish() + again.finish();
  EXPECT_THAT(both, HasSubstr("two processes were started as rank 1"));
}

TEST(RanksReject, ARankThatDoesNotCome) {
  const int port = free_port();
  Process first(0, 2, port, 1500, 10);
  EXPECT_THAT(first.finish(), AllOf(HasSubstr("waited 4 s for rank 1 of 2"), HasSubstr("127.0.0.1:")));
  Process second(1, 2, port, 1500, 10);
  EXPECT_THAT(second.finish(), HasSubstr("rank 0 did not answer at 127.0.0.1:" + std::to_string(port)));
}

}  // namespace
}  // namespace doppel::ranks_test
