#include "doppel/train/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

namespace doppel::schedule_test {
namespace {

Schedule make(Schedule::Kind kind) {
  Schedule s;
  s.kind = kind;
  s.learning_rate = 0.5;
  s.iterations = 110;
  s.warmup = 10;
  s.final_ratio = 0.2;
  s.factor = 0.1;
  s.interval = 20;
  return s;
}

TEST(ScheduleReference, WarmupGrowsLinearlyInEveryKind) {
  for (auto kind :
       {Schedule::Kind::constant, Schedule::Kind::cosine, Schedule::Kind::step, Schedule::Kind::exponential}) {
    const Schedule s = make(kind);
    EXPECT_DOUBLE_EQ(s.rate(0), 0.05);
    EXPECT_DOUBLE_EQ(s.rate(4), 0.25);
    EXPECT_DOUBLE_EQ(s.rate(9), 0.5);
    EXPECT_DOUBLE_EQ(s.rate(10), 0.5);
  }
}

TEST(ScheduleReference, Constant) { EXPECT_DOUBLE_EQ(make(Schedule::Kind::constant).rate(100000), 0.5); }

TEST(ScheduleReference, CosineFallsToItsFinalRatioAndStaysThere) {
  const Schedule s = make(Schedule::Kind::cosine);
  EXPECT_NEAR(s.rate(60), 0.5 * 0.6, 1e-12);  // half way: mean of 1 and 0.2
  EXPECT_NEAR(s.rate(110), 0.1, 1e-12);
  EXPECT_NEAR(s.rate(500), 0.1, 1e-12);
  for (int step = 10; step < 110; ++step) EXPECT_GE(s.rate(step), s.rate(step + 1));
}

TEST(ScheduleReference, StepFallsAtWholeIntervals) {
  const Schedule s = make(Schedule::Kind::step);
  EXPECT_DOUBLE_EQ(s.rate(29), 0.5);
  EXPECT_DOUBLE_EQ(s.rate(30), 0.05);
  EXPECT_NEAR(s.rate(50), 0.005, 1e-15);
}

TEST(ScheduleReference, ExponentialFallsSmoothly) {
  const Schedule s = make(Schedule::Kind::exponential);
  EXPECT_NEAR(s.rate(20), 0.5 * std::sqrt(0.1), 1e-12);
  EXPECT_NEAR(s.rate(30), 0.05, 1e-12);
}

TEST(ScheduleReference, ReadsItsKeys) {
  const auto document = ConfigDocument::parse(
      "learning_rate: 0.01\nschedule: exponential\nwarmup: 3\ndecay_factor: 0.5\ndecay_interval: 7\nfinal_ratio: 0.1\n",
      "c.yaml");
  const auto reader = document.root();
  const Schedule s = Schedule::read(reader, 99);
  reader.finish();
  EXPECT_EQ(s.kind, Schedule::Kind::exponential);
  EXPECT_EQ(s.iterations, 99);
  EXPECT_NEAR(s.rate(10), 0.005, 1e-12);
}

TEST(ScheduleRejects, UnknownKindAndNegativeRate) {
  EXPECT_THROW(Schedule::read(ConfigDocument::parse("schedule: cosines\n", "c.yaml").root(), 1), FileError);
  EXPECT_THROW(Schedule::read(ConfigDocument::parse("learning_rate: -1\n", "c.yaml").root(), 1), FileError);
}

}  // namespace
}  // namespace doppel::schedule_test
