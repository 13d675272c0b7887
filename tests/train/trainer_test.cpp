#include "doppel/train/trainer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "train/toy_stage.h"

namespace doppel::trainer_test {

using support::message_of;
using support::TemporaryFolder;

namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::ToyStage;

TrainerOptions quick(std::int64_t iterations = 30) {
  TrainerOptions o;
  o.iterations = iterations;
  o.schedule.learning_rate = 1e-2;
  o.checkpoint_every = 10;
  o.log_every = 7;
  return o;
}

TEST(TrainerRecovers, ToyProblemIsLearnedAndEverythingWritten) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  const auto summary = Trainer(stage, quick(400), run).run();
  EXPECT_EQ(summary.reason, StopReason::finished);
  EXPECT_EQ(summary.step, 400);
  const auto metrics = read_metrics(run.metrics());
  ASSERT_EQ(metrics.size(), 58u);  // every 7 steps and the last
  EXPECT_EQ(metrics.back().step, 400);
  EXPECT_LT(metrics.back().loss, 0.5 * metrics.front().loss);
  EXPECT_DOUBLE_EQ(metrics[3].terms[0].weighted, 2.0 * metrics[3].terms[0].raw);
  std::vector<std::string> parts;
  for (const auto& part : metrics[3].milliseconds) parts.push_back(part.first);
  EXPECT_THAT(parts, ::testing::UnorderedElementsAre("load", "backward", "optimiser"));
  EXPECT_TRUE(std::filesystem::exists(run.report()));
  EXPECT_TRUE(std::filesystem::exists(run.images() / "toy.jpg"));
  EXPECT_EQ(read_file(run.checkpoints() / "latest"), "step-000400.pt\n");
}

TEST(TrainerReference, EvaluationBuffersAreSavedWithoutTouchingTheModel) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  TrainerOptions options = quick(10);
  options.adam.mean_decay = 0.9;
  Trainer(stage, options, run).run();
  const auto checkpoint = CheckpointFolder(run.checkpoints()).load_latest()->second;
  EXPECT_EQ(checkpoint.tensor("evaluation.norm.running_mean")[0].item<float>(), 42.0f);
  EXPECT_NE(checkpoint.tensor("model.norm.running_mean")[0].item<float>(), 42.0f);
  EXPECT_FALSE(torch::equal(checkpoint.tensor("optimizer.mean.first"), checkpoint.tensor("model.first")));
  EXPECT_TRUE(torch::equal(stage.toy().first, checkpoint.tensor("model.first")));
}

TEST(TrainerRecovers, TheBestCheckpointOnValidationFramesIsKeptAndUsed) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  stage.validation = [&stage](std::int64_t step) {
    EXPECT_FALSE(stage.model().is_training());
    EXPECT_EQ(stage.toy().norm->running_mean[0].item<float>(), 42.0f) << "the evaluation buffers are in the model";
    return std::optional<double>(std::abs(static_cast<double>(step) - 20.0));
  };
  TrainerOptions options = quick(60);
  options.keep_last = 1;
  options.keep_best = true;
  Trainer(stage, options, run).run();
  const CheckpointFolder checkpoints(run.checkpoints());
  EXPECT_EQ(checkpoints.steps(), (std::vector<std::int64_t>{20, 60}));
  EXPECT_EQ(checkpoints.load_latest()->first, 60);
  EXPECT_EQ(checkpoints.load_for_use()->first, 20);
  EXPECT_EQ(checkpoints.load_for_use()->second.validation_loss(), 0.0);
  std::vector<double> losses;
  for (const MetricsRecord& record : read_metrics(run.validation())) losses.push_back(record.loss);
  EXPECT_EQ(losses, (std::vector<double>{10, 0, 10, 20, 30, 40}));
  EXPECT_THAT(read_file(run.report()), HasSubstr("Loss on validation frames"));
}

TEST(TrainerReference, WithoutKeepBestTheNewestCheckpointIsUsed) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  stage.validation = [](std::int64_t step) { return std::optional<double>(static_cast<double>(step)); };
  Trainer(stage, quick(30), run).run();
  EXPECT_EQ(CheckpointFolder(run.checkpoints()).load_for_use()->first, 30);
}

TEST(TrainerRecovers, ValidationLinesOfAResumedRunAreThoseOfAnUnbrokenRun) {
  const TemporaryFolder folder;
  const auto losses = [&](const char* name, std::vector<std::int64_t> sessions) {
    const RunFolder run(folder / name);
    std::vector<double> found;
    for (const std::int64_t end : sessions) {
      run.open("stage: toy\n", RunMode::automatic);
      ToyStage stage;
      stage.validation = [&stage](std::int64_t) {
        return std::optional<double>(stage.toy().first.sum().item<double>());
      };
      Trainer(stage, quick(end), run).run();
    }
    for (const MetricsRecord& record : read_metrics(run.validation())) found.push_back(record.loss);
    return found;
  };
  const std::vector<double> unbroken = losses("unbroken", {50});
  EXPECT_EQ(unbroken.size(), 5u);
  EXPECT_EQ(losses("broken", {20, 30, 50}), unbroken);
}

TEST(TrainerRejects, KeepBestWithoutValidationFrames) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  TrainerOptions options = quick(30);
  options.keep_best = true;
  EXPECT_THAT(message_of<Error>([&] { Trainer(stage, options, run).run(); }), HasSubstr("validation"));
}

TEST(TrainerRejects, NonFiniteLossNamesStageStepBatchAndTerm) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  stage.spoil = [](std::int64_t step, LossTerms& terms) {
    if (step == 23) terms[1].value = terms[1].value * std::numeric_limits<double>::quiet_NaN();
  };
  const std::string text = message_of<Error>([&] { Trainer(stage, quick(), run).run(); });
  EXPECT_THAT(text, AllOf(HasSubstr("stage toy"), HasSubstr("step 24"), HasSubstr("`size`"), HasSubstr("nan"),
                          HasSubstr(stage.batch_description()), HasSubstr("step 20 is kept")));
  EXPECT_EQ(CheckpointFolder(run.checkpoints()).load_latest()->first, 20);
}

TEST(TrainerRejects, NonFiniteGradientNamesTheParameterAndLeavesItAlone) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  // sqrt(|b - b|) is 0 and its gradient 0/0: the loss is fine, the gradient is not.
  stage.spoil = [&stage](std::int64_t step, LossTerms& terms) {
    if (step == 5)
      terms.push_back({"root", torch::sqrt(stage.toy().bias - stage.toy().bias.detach()).sum(), 1.0});
    else
      terms.push_back({"root", torch::zeros({}), 1.0});
  };
  const std::string text = message_of<Error>([&] { Trainer(stage, quick(), run).run(); });
  EXPECT_THAT(text, AllOf(HasSubstr("step 6"), HasSubstr("`bias`"), HasSubstr("root = 0")));
  EXPECT_TRUE(torch::isfinite(stage.toy().bias).all().item<bool>());
}

TEST(TrainerRecovers, StopRequestWritesACheckpointAndTheSameCommandGoesOn) {
  const TemporaryFolder folder;
  const RunFolder whole(folder / "whole"), stopped(folder / "stopped");
  whole.open("stage: toy\n", RunMode::automatic);
  ToyStage first;
  Trainer(first, quick(), whole).run();

  stopped.open("stage: toy\n", RunMode::automatic);
  ToyStage second;
  second.spoil = [](std::int64_t step, LossTerms&) {
    if (step == 12) request_stop();
  };
  const auto summary = Trainer(second, quick(), stopped).run();
  request_stop(false);
  EXPECT_EQ(summary.reason, StopReason::interrupted);
  EXPECT_EQ(summary.step, 13);
  stopped.open("stage: toy\n", RunMode::automatic);
  ToyStage third;
  const auto resumed = Trainer(third, quick(), stopped).run();
  EXPECT_EQ(resumed.resumed_at, 13);
  EXPECT_EQ(resumed.step, 30);
  for (const auto& item : first.toy().named_parameters())
    EXPECT_TRUE(torch::equal(item.value(), third.toy().named_parameters()[item.key()])) << item.key();
}

TEST(TrainerRecovers, TimeLimitEndsTheRunInOrder) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  TrainerOptions options = quick(1000000);
  options.checkpoint_every = 1000000;
  options.max_minutes = 0.3 / 60.0;
  const auto summary = Trainer(stage, options, run).run();
  EXPECT_EQ(summary.reason, StopReason::time_limit);
  EXPECT_GT(summary.step, 0);
  EXPECT_EQ(CheckpointFolder(run.checkpoints()).load_latest()->first, summary.step);
}

TEST(TrainerRejects, OtherDataThanTheCheckpoints) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  ToyStage stage;
  Trainer(stage, quick(10), run).run();
  ToyStage other;
  other.identity_ = "another actor";
  EXPECT_THAT(message_of<Error>([&] { Trainer(other, quick(20), run).run(); }),
              AllOf(HasSubstr("toy data"), HasSubstr("another actor"), HasSubstr("--overwrite")));
}

/// A toy whose data have a checksum.
class CheckedToy : public ToyStage {
 public:
  explicit CheckedToy(std::string sum) : sum_(std::move(sum)) {}
  std::string content() const override { return sum_; }

 private:
  std::string sum_;
};

TEST(TrainerRejects, AnotherRecordingOfTheSameName) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  run.open("stage: toy\n", RunMode::automatic);
  CheckedToy stage("1234"), same("1234"), other("5678");
  Trainer(stage, quick(10), run).run();
  EXPECT_THAT(message_of<UsageError>([&] { Trainer(other, quick(20), run).run(); }), HasSubstr("another recording"));
  EXPECT_EQ(Trainer(same, quick(20), run).run().resumed_at, 10);
}

TEST(RunFolderRejects, AnotherConfigurationNamingTheKeys) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "run");
  const std::string config = "stage: toy\ntrain: {iterations: 10, max_minutes: 3}\nloss: {a: 1}\n";
  run.open(config, RunMode::automatic);
  ToyStage stage;
  Trainer(stage, quick(10), run).run();
  const std::string other = "stage: toy\ntrain: {iterations: 20, max_minutes: 9}\n";
  const std::string text = message_of<Error>([&] { run.open(other, RunMode::automatic); });
  EXPECT_THAT(text, AllOf(HasSubstr("train.iterations: 10 -> 20"), HasSubstr("loss.a: 1 -> (default)"),
                          HasSubstr("--overwrite")));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("max_minutes")));
  EXPECT_THROW(run.open(other, RunMode::resume), UsageError);
  run.open(other, RunMode::overwrite);
  EXPECT_TRUE(CheckpointFolder(run.checkpoints()).steps().empty());
  EXPECT_FALSE(std::filesystem::exists(run.metrics()));
}

TEST(RunFolderReference, EqualNumbersAreNoDifference) {
  EXPECT_TRUE(config_differences("a: {rate: 2e-3, list: [1, 0.5]}\n", "a: {rate: 0.002, list: [1.0, 5e-1]}\n").empty());
  EXPECT_EQ(config_differences("a: 2e-3\n", "a: 3e-3\n").size(), 1u);
  EXPECT_EQ(config_differences("a: [1, 2]\n", "a: [2, 1]\n").size(), 1u);
  EXPECT_TRUE(config_differences("a: [{rate: 2e-3}]\n", "a: [{rate: 0.002}]\n").empty());
  EXPECT_EQ(config_differences("a: ['01']\n", "a: ['1']\n").size(), 1u) << "names";
  EXPECT_EQ(config_differences("a: ['x, y']\n", "a: [x, y]\n").size(), 1u);
  EXPECT_EQ(config_differences("seed: 9007199254740992\n", "seed: 9007199254740993\n").size(), 1u);
}

TEST(RunFolderRejects, FoldersThatAreNotRuns) {
  const TemporaryFolder folder;
  write_atomically(folder / "full" / "thesis.tex", "precious");
  EXPECT_THROW(RunFolder(folder / "full").open("a: 1\n", RunMode::overwrite), UsageError);
  EXPECT_THROW(RunFolder(folder / "full" / "thesis.tex").open("a: 1\n", RunMode::automatic), UsageError);
  EXPECT_THROW(RunFolder(folder / "new").open("a: 1\n", RunMode::resume), UsageError);
  EXPECT_EQ(read_file(folder / "full" / "thesis.tex"), "precious");
}

}  // namespace
}  // namespace doppel::trainer_test
