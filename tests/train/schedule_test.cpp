#include "doppel/train/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/config.h"

namespace doppel::schedule_test {
namespace {

Schedule make(Schedule::Kind kind) {
  Schedule s;
  s.kind = kind;
  s.learning_rate = 0.5;
  s.iterations = 110;
  s.warmup = 10;
  s.final_ratio = 0.2;
  return s;
}

TEST(ScheduleReference, WarmupGrowsLinearlyInEveryKind) {
  for (auto kind : {Schedule::Kind::constant, Schedule::Kind::cosine}) {
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

TEST(ScheduleReference, ReadsItsKeys) {
  const auto document =
      ConfigDocument::parse("learning_rate: 0.01\nschedule: cosine\nwarmup: 3\nfinal_ratio: 0.1\n", "c.yaml");
  const auto reader = document.root();
  Schedule s = read_options<Schedule>(reader);
  reader.finish();
  EXPECT_EQ(s.kind, Schedule::Kind::cosine);
  s.iterations = 99;
  EXPECT_NEAR(s.rate(99), 0.001, 1e-12);
}

TEST(ScheduleRejects, UnknownKindAndNegativeRate) {
  EXPECT_THROW(read_options<Schedule>(ConfigDocument::parse("schedule: cosines\n", "c.yaml").root()), FileError);
  EXPECT_THROW(read_options<Schedule>(ConfigDocument::parse("learning_rate: -1\n", "c.yaml").root()), FileError);
}

}  // namespace
}  // namespace doppel::schedule_test
