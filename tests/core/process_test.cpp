#include "doppel/core/process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>

#include "doppel/core/cpu_dispatch.h"
#include "doppel/core/error.h"
#include "doppel/core/isa_choice.h"
#include "doppel/core/log.h"
#include "doppel/core/progress.h"

namespace doppel::process_test {
namespace {

using ::testing::ExitedWithCode;
using ::testing::HasSubstr;
using ::testing::internal::CaptureStderr;
using ::testing::internal::GetCapturedStderr;

TEST(ProcessReference, ThreadCounts) {
  EXPECT_EQ(resolve_threads(3), 3);
  EXPECT_GE(resolve_threads(0), 1);
  ASSERT_EQ(setenv("OMP_NUM_THREADS", "2", 1), 0);
  EXPECT_EQ(resolve_threads(0), 2);
  EXPECT_EQ(resolve_threads(3), 3);
  for (const char* none : {"", "many", "0", "-4"}) {
    ASSERT_EQ(setenv("OMP_NUM_THREADS", none, 1), 0);
    EXPECT_GE(resolve_threads(0), 1);
  }
  ASSERT_EQ(unsetenv("OMP_NUM_THREADS"), 0);
  EXPECT_THROW(resolve_threads(-1), UsageError);
  EXPECT_THROW(resolve_threads(1025), UsageError);
}

TEST(ProcessReference, ASignalIsARequest) {
  setup_process();
  request_stop(false);
  raise(SIGTERM);
  EXPECT_TRUE(stop_requested());
  request_stop(false);
  EXPECT_FALSE(stop_requested());
  request_stop();
  EXPECT_TRUE(stop_requested());
  request_stop(false);
}

TEST(ProcessDeathTest, ASecondSignalEndsIt) {
  EXPECT_EXIT(
      {
        setup_process();
        raise(SIGINT);
        raise(SIGINT);
      },
      ExitedWithCode(128 + SIGINT), "");
}

/// Whether cmake/arm64-linux.cmake runs this test.
bool is_emulated() { return std::getenv("DOPPEL_TEST_EMULATED") != nullptr; }
constexpr const char* kCannotStartItself = "the kernel starts no program of another processor";

long page_faults() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_minflt;
}

TEST(ProcessReference, LargeBlocksStayInTheProcess) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
  GTEST_SKIP() << "another allocator is in charge";
#endif
  setup_process();
  constexpr std::size_t kBytes = 64 << 20;
  const auto touch = [] {
    const std::unique_ptr<char[]> block(new char[kBytes]);
    std::memset(block.get(), 1, kBytes);
    volatile char* first = block.get();
    return *first;
  };
  touch();
  const long before = page_faults();
  touch();
  EXPECT_LT(page_faults() - before, 1000) << "a block of 16384 pages was fetched from the system again";
}

TEST(CpuDispatchReference, OneInstructionSetForTheWholeProcess) {
  EXPECT_EQ(cpu_isa(), cpu_isa());
  EXPECT_STREQ(isa_name(Isa::baseline), "plain");
  EXPECT_STREQ(isa_name(Isa::avx2), "avx2");
  EXPECT_STREQ(isa_name(Isa::avx512), "avx512");
}

TEST(CpuDispatchReference, TheEnvironmentLowersIt) {
  if (is_emulated()) GTEST_SKIP() << kCannotStartItself;
  EXPECT_EXIT(
      {
        setenv("DOPPEL_ISA", "plain", 1);
        // cpu_isa() has been called in this process if a kernel pointer exists; a fresh one is needed.
        execl("/proc/self/exe", "core_test", "--gtest_brief=1",
              "--gtest_filter=CpuDispatchReference.NeverAboveTheEnvironment", static_cast<char*>(nullptr));
      },
      ExitedWithCode(0), "");
}
// In a process that DOPPEL_ISA lowered (the one above starts it so) as well as in an ordinary one.
TEST(CpuDispatchReference, NeverAboveTheEnvironment) {
  const char* wish = std::getenv("DOPPEL_ISA");
  if (wish && std::strcmp(wish, "plain") == 0) {
    EXPECT_EQ(cpu_isa(), Isa::baseline);
  } else {
    EXPECT_LE(cpu_isa(), Isa::avx512);
  }
}

TEST(CpuDispatchRejects, UnknownInstructionSets) {
  const char* found = std::getenv("DOPPEL_ISA");
  const std::string before = found ? found : "";
  EXPECT_NO_THROW(check_isa());
  for (const char* unknown : {"avx1024", "AVX2", "baseline", ""}) {
    setenv("DOPPEL_ISA", unknown, 1);
    try {
      check_isa();
      ADD_FAILURE() << "accepted '" << unknown << "'";
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), HasSubstr("found '" + std::string(unknown) + "'; this processor has plain"));
    }
  }
  setenv("DOPPEL_ISA", "plain", 1);
  EXPECT_NO_THROW(check_isa());
  found ? setenv("DOPPEL_ISA", before.c_str(), 1) : unsetenv("DOPPEL_ISA");
}

// Runs in a process of its own, which starts itself once more: then the variable is there.
TEST(ProcessReference, SpinningIsLimitedByStartingOnceMore) {
  if (is_emulated()) GTEST_SKIP() << kCannotStartItself;
  const auto run = [](const char* policy) {
    setenv("DOPPEL_TEST_STARTED_AGAIN", "1", 1);
    unsetenv("GOMP_SPINCOUNT");
    unsetenv("OPENBLAS_CORETYPE");
    policy ? setenv("OMP_WAIT_POLICY", policy, 1) : unsetenv("OMP_WAIT_POLICY");
    std::string name = "core_test", filter = "--gtest_filter=ProcessReference.TheSpinCountIsSet";
    char* arguments[] = {name.data(), filter.data(), nullptr};
    start_tuned(arguments);
    _exit(std::getenv("GOMP_SPINCOUNT") ? 3 : 4);  // it returned
  };
  EXPECT_EXIT(run(nullptr), ExitedWithCode(0), "");
  EXPECT_EXIT(run("ACTIVE"), ExitedWithCode(4), "");  // the user's choice stays
}
TEST(ProcessReference, TheSpinCountIsSet) {
  if (!std::getenv("DOPPEL_TEST_STARTED_AGAIN")) GTEST_SKIP() << "the test above runs this one";
  const char* count = std::getenv("GOMP_SPINCOUNT");
  ASSERT_NE(count, nullptr);
  EXPECT_GT(std::atoi(count), 0);
  if (cpu_isa() == Isa::avx512) {
    EXPECT_STREQ(std::getenv("OPENBLAS_CORETYPE"), "SkylakeX");
  }
  char* arguments[] = {nullptr};
  start_tuned(arguments);  // does not start it a third time
}

TEST(LogRejects, UnknownLevels) {
  EXPECT_THROW(setup_logging("loud"), UsageError);
  EXPECT_THROW(setup_logging(""), UsageError);
}

TEST(LogReference, LinesGoToStderr) {
  CaptureStderr();
  ::testing::internal::CaptureStdout();
  setup_logging("info");
  log::info("seen {}", 1);
  log::debug("hidden");
  spdlog::default_logger()->flush();
  setup_logging("warn");
  log::info("hidden too");
  const std::string lines = GetCapturedStderr();
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_THAT(lines, ::testing::MatchesRegex("[0-9:]+ info seen 1\n"));
  setup_logging("info");
}

TEST(ProgressReference, APlainLineWhereThereIsNoTerminal) {
  CaptureStderr();
  {
    Progress progress("preparing", 100, 40);
    for (int i = 0; i < 60; ++i) progress.advance(1, "loss 0.5");
    progress.finish();
    progress.finish();
  }
  const std::string shown = GetCapturedStderr();
  EXPECT_EQ(shown.find('\r'), std::string::npos);
  EXPECT_EQ(std::count(shown.begin(), shown.end(), '\n'), 1) << shown;
  EXPECT_THAT(shown, HasSubstr("preparing 100/100 100%"));
  EXPECT_THAT(shown, HasSubstr("loss 0.5"));
}

TEST(ProgressReference, NothingToDo) {
  CaptureStderr();
  { Progress progress("idle", 0); }
  EXPECT_THAT(GetCapturedStderr(), HasSubstr("idle 0/0 100%"));
}

TEST(ProgressReference, DroppedStepsAreNotMissing) {
  CaptureStderr();
  {
    Progress progress("bending", 8);
    progress.advance(3);
    progress.drop(5);
  }
  EXPECT_THAT(GetCapturedStderr(), HasSubstr("bending 3/3 100%"));
}

TEST(ProgressReference, Durations) {
  EXPECT_EQ(format_duration(95), "1:35");
  EXPECT_EQ(format_duration(4000), "1:06:40");
  EXPECT_EQ(format_duration(0.4), "0:00");
  EXPECT_EQ(format_duration(59.7), "1:00");
  EXPECT_EQ(format_duration(-3), "0:00");
}

TEST(ErrorReference, PositionsComeFirst) {
  try {
    fail_at({"a.obj", 7}, "found {}", 3);
  } catch (const FileError& e) {
    EXPECT_STREQ(e.what(), "a.obj:7: found 3");
    EXPECT_EQ(e.location.line, 7);
  }
  EXPECT_EQ((FileLocation{"a.obj", 0}).to_string(), "a.obj");
  EXPECT_THROW(fail<UsageError>("x"), UsageError);
}

}  // namespace
}  // namespace doppel::process_test
