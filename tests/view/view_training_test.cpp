#include "doppel/view/view_training.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/train/metrics.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::view_training_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

nlohmann::json state_of(const std::filesystem::path& run) { return nlohmann::json::parse(training_state(run)); }

void log_steps(const std::filesystem::path& stage, int first, int last) {
  std::filesystem::create_directories(stage);
  MetricsFile file(stage / "metrics.jsonl", first - 1);
  for (int step = first; step <= last; ++step) {
    MetricsRecord record;
    record.step = step;
    record.seconds = 0.5 * step;
    record.loss = 1.0 / step;
    record.terms = {{"silhouette", 2.0, 0.75 / step}, {"arap", 1.0, 0.25 / step}};
    file.append(record);
  }
}

TEST(ViewTraining, FollowsARunThatTrains) {
  const TemporaryFolder folder;
  EXPECT_TRUE(state_of(folder.path())["stages"].empty());
  log_steps(folder / "egnet", 1, 3);
  EXPECT_EQ(state_of(folder.path())["stages"][0]["steps"], 3);
  log_steps(folder / "egnet", 4, 1200);
  log_steps(folder / "lighting", 1, 2);
  const auto stages = state_of(folder.path())["stages"];
  ASSERT_EQ(stages.size(), 2U);
  EXPECT_EQ(stages[0]["name"], "egnet");
  EXPECT_EQ(stages[0]["seconds"], 600.0);
  const auto& loss = stages[0]["curves"]["loss"];
  EXPECT_LE(loss.size(), 500U);
  EXPECT_GE(loss.size(), 250U);
  EXPECT_EQ(loss.back(), (nlohmann::json{1200, 1.0 / 1200}));
  EXPECT_EQ(stages[1]["curves"]["arap"].back(), (nlohmann::json{2, 0.125}));
}

TEST(ViewTraining, FollowsARunThatCapturesPoses) {
  const TemporaryFolder folder;
  log_steps(folder / "posenet", 1, 3);
  log_steps(folder / "defnet", 1, 2);
  const auto stages = state_of(folder.path())["stages"];
  ASSERT_EQ(stages.size(), 2U);
  EXPECT_EQ(stages[0]["name"], "posenet");
  EXPECT_EQ(stages[1]["steps"], 2);
}

TEST(ViewTraining, ShowsItsImages) {
  const TemporaryFolder folder;
  log_steps(folder.path(), 1, 1);
  std::filesystem::create_directories(folder / "pictures");
  write_atomically(folder / "pictures/overlay-train.jpg", std::string("jpeg bytes"));
  write_atomically(folder / "pictures/overlay-train.txt", std::string("step 1: outlines"));
  write_atomically(folder / "pictures/notes.md", std::string("none of it"));
  const auto images = state_of(folder.path())["stages"][0]["images"];
  ASSERT_EQ(images.size(), 1U);
  EXPECT_EQ(images[0]["caption"], "step 1: outlines");
  EXPECT_EQ(training_image(folder.path(), 0, 0), "jpeg bytes");
  EXPECT_THAT(message_of<UsageError>([&] { training_image(folder.path(), 0, 1); }), HasSubstr("there are 1"));
  EXPECT_THAT(message_of<UsageError>([&] { training_image(folder.path(), 0, -1); }), HasSubstr("no image -1"));
  EXPECT_THAT(message_of<UsageError>([&] { training_image(folder.path(), 1, 0); }), HasSubstr("1 stages have begun"));
}

}  // namespace
}  // namespace doppel::view_training_test
