#include "doppel/train/metrics.h"

#include <gtest/gtest.h>

#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/temporary_folder.h"

namespace doppel::metrics_test {

using support::TemporaryFolder;

namespace {

MetricsRecord record(std::int64_t step) {
  MetricsRecord r;
  r.step = step;
  r.seconds = 0.1 * static_cast<double>(step);
  r.learning_rate = 1e-4 / 3.0;
  r.loss = 1.0 / static_cast<double>(step);
  r.terms = {{"silhouette", 0.1, 10.0}, {"arap", 1e-9, 1.5e-6}};
  r.gradient_norm = 3.25;
  r.milliseconds = {{"load", 1.5}, {"backward", 20.0}};
  return r;
}

TEST(MetricsRecovers, LinesRoundTripExactly) {
  const TemporaryFolder folder;
  {
    MetricsFile file(folder / "metrics.jsonl", 0);
    for (int step = 1; step <= 3; ++step) file.append(record(step));
  }
  const auto read = read_metrics(folder / "metrics.jsonl");
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[2].loss, 1.0 / 3.0);
  EXPECT_EQ(read[2].learning_rate, 1e-4 / 3.0);
  ASSERT_EQ(read[2].terms.size(), 2u);
}

TEST(MetricsRecovers, ResumingDropsLaterAndHalfWrittenLines) {
  const TemporaryFolder folder;
  const auto path = folder / "metrics.jsonl";
  {
    MetricsFile file(path, 0);
    for (int step = 10; step <= 50; step += 10) file.append(record(step));
  }
  std::ofstream(path, std::ios::app) << "{\"step\": 60, \"sec";
  { MetricsFile file(path, 30); }
  std::string expected;
  for (int step = 10; step <= 30; step += 10) expected += record(step).to_line() + "\n";
  EXPECT_EQ(read_file(path), expected);
}

TEST(MetricsRejects, ForeignLinesAreLeftOut) {
  const TemporaryFolder folder;
  const auto path = folder / "metrics.jsonl";
  std::ofstream(path) << "\r\n[1,2]\n{\"step\": \"x\"}\nnonsense\n" << record(1).to_line() << "\r\n";
  const auto read = read_metrics(path);
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].step, 1);
  EXPECT_TRUE(read_metrics(folder / "none").empty());
}

TEST(MetricsWindowReference, MeansOverTheWindow) {
  MetricsWindow window;
  Profile profile;
  profile.add("backward", 0.010);
  window.add({{"a", 1.0, 2.0}}, 3.0, profile);
  window.add({{"a", 2.0, 4.0}}, 5.0, profile);
  const MetricsRecord r = window.take();
  EXPECT_DOUBLE_EQ(r.terms[0].raw, 1.5);
  EXPECT_DOUBLE_EQ(r.loss, 3.0);
  EXPECT_DOUBLE_EQ(r.gradient_norm, 4.0);
  EXPECT_NEAR(r.milliseconds[0].second, 10.0, 1e-9);
  EXPECT_EQ(window.steps(), 0);
}

TEST(MetricsWindowRecovers, StateContinuesToTheBit) {
  MetricsWindow whole, first;
  for (int i = 1; i <= 7; ++i) whole.add({{"a", 1.0 / i, 0.1 / i}}, 1.0 / (3 * i), {});
  for (int i = 1; i <= 3; ++i) first.add({{"a", 1.0 / i, 0.1 / i}}, 1.0 / (3 * i), {});
  MetricsWindow second;
  second.restore(first.state());
  for (int i = 4; i <= 7; ++i) second.add({{"a", 1.0 / i, 0.1 / i}}, 1.0 / (3 * i), {});
  EXPECT_EQ(whole.take().to_line(), second.take().to_line());
}

TEST(MetricsWindowRejects, StateOfAnotherVersion) {
  MetricsWindow window;
  EXPECT_THROW(window.restore("{\"count\": 3}"), Error);
  EXPECT_THROW(window.restore(""), Error);
}

}  // namespace
}  // namespace doppel::metrics_test
