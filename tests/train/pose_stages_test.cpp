#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/actor/checkpoint.h"
#include "doppel/actor/trained_pose.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/train/def_net_stage.h"
#include "doppel/train/pose_net_stage.h"
#include "doppel/train/stage_chain.h"
#include "support/message_of.h"
#include "support/small_pose_run.h"

namespace doppel::pose_stages_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

TEST(PosePhases, AreTheThesissWhereTheConfigurationIsSilent) {
  const PosePhases phases;
  EXPECT_EQ(phases.iterations(), 360000);
  const Schedule schedule = phases.schedule();
  EXPECT_EQ(schedule.rate(0), 1e-5);
  EXPECT_EQ(schedule.rate(119999), 1e-5);
  EXPECT_EQ(schedule.rate(120000), 1e-6);
  EXPECT_EQ(schedule.rate(359999), 1e-6);
  const auto weights = [&](std::int64_t step) {
    const PosePhases::Position position = phases.at(step);
    return std::make_pair(position.phase->keypoints, position.phase->limits_weight(position.progress));
  };
  EXPECT_EQ(weights(0), std::make_pair(0.01, 1.0));
  EXPECT_EQ(weights(39999), std::make_pair(0.01, 1.0));
  EXPECT_EQ(weights(40001), std::make_pair(0.01, 0.1));
  EXPECT_EQ(weights(60000), std::make_pair(0.01, 0.0));
  EXPECT_EQ(weights(120000), std::make_pair(1e-4, 0.0));
  EXPECT_EQ(weights(240000), std::make_pair(1e-5, 0.0));
  EXPECT_DOUBLE_EQ(phases.at(180000).progress, 0.5);
}

TEST(PosePhases, AreReadFromTheConfiguration) {
  const PosePhases phases = read_options<PosePhases>(
      ConfigDocument::parse("phases:\n  - {iterations: 10, learning_rate: 0.1, limits: 2, limits_off_at: 0.2}\n"
                            "  - {iterations: 5, keypoints: 3}\n",
                            "c.yaml")
          .root());
  EXPECT_EQ(phases.iterations(), 15);
  EXPECT_EQ(phases.at(1).phase->limits_weight(phases.at(1).progress), 2.0);
  EXPECT_EQ(phases.at(2).phase->limits_weight(phases.at(2).progress), 0.0);
  EXPECT_EQ(phases.at(12).phase->keypoints, 3.0);
  EXPECT_EQ(phases.schedule().rate(9), 0.1);
}

TEST(PoseConfigurations, ThatComeAlongAreReadable) {
  for (const std::string size : {"tiny", "small", "paper"}) {
    const fs::path path = fs::path(DOPPEL_SOURCE_DIR) / "configs" / size / "deepcap.yaml";
    const StageChain chain = StageChain::read(ConfigDocument::load(path, {"capture=/somewhere"}));
    EXPECT_TRUE(chain.has("posenet") && !chain.borrowed("posenet"));
    EXPECT_TRUE(chain.has("defnet"));
    EXPECT_FALSE(chain.has("egnet"));
    const StageChain second =
        StageChain::read(ConfigDocument::load(path, {"capture=/somewhere", "posenet={run: /elsewhere}"}));
    EXPECT_TRUE(second.borrowed("posenet"));
    EXPECT_FALSE(second.borrowed("defnet"));
  }
  const StageChain ablation = StageChain::read(
      ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/ablation/deepcap.yaml",
                           {"capture=/somewhere", "posenet.data.frames=[0,4,8]", "defnet.data.cameras=[0,2]"}));
  EXPECT_EQ(PoseNetRunConfig::read(ablation.stage("posenet")).loader.frames, (std::vector<long>{0, 4, 8}));
  EXPECT_EQ(DefNetRunConfig::read(ablation.stage("defnet")).loader.cameras.size(), 2u);
  const StageChain thesis_chain = StageChain::read(
      ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/paper/deepcap.yaml", {"capture=/somewhere"}));
  const PoseNetRunConfig paper = PoseNetRunConfig::read(thesis_chain.stage("posenet"));
  EXPECT_EQ(paper.loader.batch_size, 90);
  const PosePhases thesis;
  EXPECT_EQ(paper.trainer.iterations, thesis.iterations());
  for (std::int64_t step : {0, 39000, 41000, 61000, 130000, 250000}) {
    const PosePhases::Position found = paper.phases.at(step), expected = thesis.at(step);
    EXPECT_EQ(paper.trainer.schedule.rate(step), thesis.schedule().rate(step));
    EXPECT_EQ(found.phase->keypoints, expected.phase->keypoints);
    EXPECT_EQ(found.phase->limits_weight(found.progress), expected.phase->limits_weight(expected.progress));
  }
}

TEST(PoseConfigurations, MistakesAreNamed) {
  const auto complaint = [](const std::string& text) {
    return message_of([&] { StageChain::read(ConfigDocument::parse("capture: x\n" + text, "c.yaml")); });
  };
  EXPECT_THAT(complaint("stage: deepcap\ndefnet: {}\n"), HasSubstr("--set 'posenet={run: RUN}'"));
  EXPECT_THAT(complaint("stage: posenet\ntrain: {iterations: 3}\n"), HasSubstr("phases"));
  EXPECT_THAT(complaint("stage: posenet\nphases: []\n"), HasSubstr("the list is empty"));
  EXPECT_THAT(complaint("stage: posenet\nmodel: {backbon: resnet18}\n"), HasSubstr("backbone"));
  EXPECT_THAT(complaint("stage: deepcap\nposenet: {}\negnet: {}\n"), HasSubstr("unknown key"));
}

class PoseTraining : public support::SmallPoseRun {
 protected:
  /// The newest checkpoints of both, to the bit.
  static void expect_equal_checkpoints(const RunFolder& one, const RunFolder& other) {
    const auto expected = CheckpointFolder(one.checkpoints()).load_latest(),
               found = CheckpointFolder(other.checkpoints()).load_latest();
    ASSERT_TRUE(expected && found);
    EXPECT_EQ(expected->first, found->first);
    ASSERT_EQ(expected->second.tensors().size(), found->second.tensors().size());
    for (const auto& [name, tensor] : expected->second.tensors())
      EXPECT_TRUE(torch::equal(tensor, found->second.tensor(name))) << name;
  }
};

TEST_F(PoseTraining, RunsBothStagesAndTheirLossesFall) {
  ASSERT_EQ(summaries_.size(), 2u);
  EXPECT_EQ(summaries_[0].summary.step, 14);
  EXPECT_EQ(summaries_[1].summary.step, 6);
  const auto metrics = read_metrics(RunFolder(*folder_ / "run/posenet").metrics());
  EXPECT_LT(metrics.back().loss, metrics.front().loss);
  EXPECT_DOUBLE_EQ(metrics.back().learning_rate, 1e-4);
  for (const char* image : {"posenet/pictures/overlay-test.jpg", "defnet/pictures/overlay-test.jpg"})
    EXPECT_TRUE(fs::exists(*folder_ / "run" / image)) << image;
}

TEST_F(PoseTraining, WeightsThatCannotBeReadLeaveTheRunAsItWas) {
  const fs::path run = *folder_ / "kept";
  fs::copy(*folder_ / "run", run, fs::copy_options::recursive);
  const std::string before = read_file(run / "config.yaml");
  ChainOptions options;
  options.mode = RunMode::overwrite;
  EXPECT_THAT(message_of<Error>([&] { train_stages(chain({"posenet.model.pretrained=gone.pth"}), run, options); }),
              HasSubstr("gone.pth"));
  EXPECT_EQ(read_file(run / "config.yaml"), before);
  EXPECT_FALSE(CheckpointFolder(RunFolder(run / "posenet").checkpoints()).steps().empty());
}

TEST_F(PoseTraining, StoppedAnywhereEqualsAnUnbrokenRunToTheBit) {
  const RunFolder run(*folder_ / "broken");
  for (const std::int64_t stop : {3, 8, 14}) {
    const PoseNetRunConfig config = PoseNetRunConfig::read(chain().stage("posenet"));
    const Dataset dataset = Dataset::open(config.subject.capture);
    const Character character = load_character(dataset.character_path(), config.subject.character);
    run.open("stage: posenet\n", RunMode::automatic);
    PoseNetStage stage(dataset, character, config);
    TrainerOptions options = config.trainer;
    options.iterations = stop;
    Trainer(stage, options, run).run();
  }
  expect_equal_checkpoints(RunFolder(*folder_ / "run/posenet"), run);
}

TEST_F(PoseTraining, DefNetStoppedAnywhereEqualsAnUnbrokenRunToTheBit) {
  const RunFolder run(*folder_ / "broken-defnet");
  for (const std::int64_t stop : {2, 5, 6}) {
    TrainedPose pose = TrainedPose::load(*folder_ / "run", std::nullopt, false);
    const Dataset dataset = Dataset::open(pose.subject.capture);
    const DefNetRunConfig config = DefNetRunConfig::read(chain().stage("defnet"));
    run.open("stage: defnet\n", RunMode::automatic);
    DefNetStage stage(dataset, pose, config);
    TrainerOptions options = config.trainer;
    options.iterations = stop;
    Trainer(stage, options, run).run();
    // Killed before it could write what it had done since step 3.
    if (stop == 5) fs::remove(CheckpointFolder(run.checkpoints()).path(5));
  }
  expect_equal_checkpoints(RunFolder(*folder_ / "run/defnet"), run);
}

TEST_F(PoseTraining, WhatWasTrainedCapturesAFrame) {
  TrainedPose trained = TrainedPose::load(*folder_ / "run");
  EXPECT_EQ(trained.steps.at("posenet"), 14);
  EXPECT_EQ(trained.steps.at("defnet"), 6);
  const Dataset dataset = Dataset::open(trained.subject.capture);
  LoaderOptions options;
  options.person_size = trained.input_size();
  const Batch batch = person_batch(dataset, dataset.samples(Split::test)[1], options);
  const CapturedPose captured = trained.capture(person_view(batch));
  EXPECT_TRUE(captured.valid.all().item<bool>());
  const torch::Tensor dofs = trained.dofs(captured);
  // The DoFs pose the landmarks where the alignment put them.
  EXPECT_LT((trained.landmark_layer->forward(dofs) - captured.landmarks).abs().max().item<float>(), 1e-4f);
  // Global alignment moves even a hardly trained pose near the person.
  EXPECT_LT((captured.position - trained.pose->position(batch.dofs.select(1, -1).contiguous())).norm().item<float>(),
            0.5f);
  const auto [A, T] = trained.deformation(batch.person.select(1, 0));
  EXPECT_EQ(A.sizes(), at::IntArrayRef({1, trained.character.num_nodes(), 3}));
  EXPECT_GT(T.abs().max().item<float>(), 0.0f);
  EXPECT_TRUE(trained.surface->deformed(dofs, A, T).isfinite().all().item<bool>());
}

TEST_F(PoseTraining, DefNetLeavesPoseNetAlone) {
  TrainedPose pose = TrainedPose::load(*folder_ / "run", std::nullopt, false);
  EXPECT_FALSE(pose.defnet);
  const std::string before = pose.digest();
  const Dataset dataset = Dataset::open(pose.subject.capture);
  DefNetStage stage(dataset, pose, DefNetRunConfig::read(chain().stage("defnet")));
  Profile profile;
  StepContext context{0, at::detail::createCPUGenerator(1), &profile};
  torch::Tensor total;
  for (const LossTerm& term : static_cast<Stage&>(stage).loss(context)) {
    EXPECT_GE(term.value.item<double>(), 0.0) << term.name;
    total = total.defined() ? total + term.value : term.value;
  }
  total.backward();
  EXPECT_EQ(pose.digest(), before);
  for (const torch::Tensor& parameter : pose.posenet->parameters()) EXPECT_FALSE(parameter.grad().defined());
  for (const auto& parameter : stage.network()->named_parameters())
    EXPECT_TRUE(parameter.value().grad().isfinite().all().item<bool>()) << parameter.key();
}

TEST_F(PoseTraining, PeopleThatNoCameraSeesHaveNoLoss) {
  const Dataset dataset = Dataset::open(*folder_ / "prepared");
  const Character character = load_character(dataset.character_path());
  PoseNetStage stage(dataset, character, PoseNetRunConfig::read(chain().stage("posenet")));
  LoaderOptions options;
  options.person_size = 64;
  Batch batch = person_batch(dataset, dataset.samples(Split::train)[0], options);
  batch.keypoints = torch::zeros_like(batch.keypoints);
  Profile profile;
  StepContext context{0, at::detail::createCPUGenerator(1), &profile};
  stage.network()->eval();
  const LossTerms terms = stage.loss(batch, context);
  EXPECT_EQ(terms[0].value.item<double>(), 0.0);
  terms[0].value.backward();
  for (const auto& parameter : stage.network()->named_parameters())
    EXPECT_EQ(parameter.value().grad().abs().max().item<double>(), 0.0) << parameter.key();
}

TEST_F(PoseTraining, TheConfigurationOfTheRunNamesTheDofs) {
  const ConfigDocument stored = ConfigDocument::load(*folder_ / "run/posenet/config.yaml");
  const std::vector<std::string> names = stored.root().section("model").list<std::string>("dofs");
  EXPECT_EQ(TrainedPose::load(*folder_ / "run").pose->names(), names);
  EXPECT_EQ(std::count(names.begin(), names.end(), "translate_x"), 0);
  EXPECT_GT(names.size(), 10u);
}

TEST_F(PoseTraining, DefNetSeesTheImageThatPoseNetSees) {
  TrainedPose pose = TrainedPose::load(*folder_ / "run");
  const Dataset dataset = Dataset::open(pose.subject.capture);
  const DefNetRunConfig config = DefNetRunConfig::read(chain({"defnet.model.input_size=96"}).stage("defnet"));
  EXPECT_THAT(message_of<UsageError>([&] { DefNetStage(dataset, pose, config); }), HasSubstr("PoseNet's is 64"));
}

}  // namespace
}  // namespace doppel::pose_stages_test
