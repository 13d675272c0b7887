#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/actor/checkpoint.h"
#include "doppel/train/metrics.h"

namespace doppel::support {

/// Lines of metrics.jsonl without what a clock or the system says.
inline std::vector<std::string> timeless_metrics(const std::filesystem::path& run) {
  std::vector<std::string> lines;
  for (MetricsRecord record : read_metrics(run / "metrics.jsonl")) {
    record.seconds = 0;
    record.milliseconds.clear();
    record.memory_mb = 0;
    lines.push_back(record.to_line());
  }
  return lines;
}

/// Expects two finished runs to be equal bit for bit: newest checkpoints and metrics.
inline void expect_same_run(const std::filesystem::path& expected_run, const std::filesystem::path& actual_run) {
  const auto expected = CheckpointFolder(expected_run / "checkpoints").load_latest();
  const auto actual = CheckpointFolder(actual_run / "checkpoints").load_latest();
  ASSERT_TRUE(expected && actual);
  ASSERT_EQ(expected->first, actual->first);
  ASSERT_EQ(expected->second.tensors().size(), actual->second.tensors().size());
  for (const auto& [name, tensor] : expected->second.tensors())
    EXPECT_TRUE(torch::equal(tensor, actual->second.tensor(name))) << name << " differs";
  for (const char* name : {"data", "step", "loss", "optimizer.steps"})
    EXPECT_EQ(expected->second.text(name), actual->second.text(name)) << name;
  EXPECT_EQ(timeless_metrics(expected_run), timeless_metrics(actual_run));
}

}  // namespace doppel::support
