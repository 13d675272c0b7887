#include "doppel/train/egnet_stage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "doppel/actor/trained_actor.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/train/stage_chain.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::egnet_stage_test {
namespace {

using support::TemporaryFolder;
using ::testing::HasSubstr;

constexpr char kConfig[] =
    "stage: egnet\n"
    "data: {batch_size: 4, cameras_per_sample: 2, input_noise: 0.01, pose_noise: 0.01}\n"
    "model: {features: 4, residual_blocks: 2, rings: 2}\n"
    "train: {iterations: 40, learning_rate: 0.005, mean_weights: 0.9, log_every: 4, checkpoint_every: 8}\n";

/// A capture that all tests here share, and a run on it.
class EgNetTraining : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    prepared_ = make_small_capture(*folder_ / "capture");
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string config_text() { return std::string("capture: ") + prepared_.string() + "\n" + kConfig; }
  static EgNetRunConfig config(const std::vector<std::string>& overrides = {}) {
    return EgNetRunConfig::read(ConfigDocument::parse(config_text(), "test.yaml", overrides));
  }
  /// Trains until `stop_at` steps are done (-1: to the end).
  static TrainSummary train(const RunFolder& run, std::int64_t stop_at = -1) {
    const EgNetRunConfig c = config();
    const Dataset dataset = Dataset::open(c.subject.capture);
    const Character character = load_character(dataset.character_path(), c.subject.character);
    run.open(config_text(), RunMode::automatic);
    EgNetStage stage(dataset, character, c);
    TrainerOptions options = c.trainer;
    if (stop_at >= 0) options.iterations = stop_at;
    return Trainer(stage, options, run).run();
  }
  static TemporaryFolder* folder_;
  static std::filesystem::path prepared_;
};
TemporaryFolder* EgNetTraining::folder_ = nullptr;
std::filesystem::path EgNetTraining::prepared_;

/// An untrained stage and its loss for two training frames in three cameras.
struct FirstLoss {
  explicit FirstLoss(const EgNetRunConfig& config)
      : dataset(Dataset::open(config.subject.capture)),
        character(load_character(dataset.character_path(), config.subject.character)),
        stage(dataset, character, config) {
    const std::vector<SampleId> samples = dataset.samples(Split::train);
    batch = make_batch(dataset, {samples[2], samples[5]}, {{0, 1, 2}, {0, 1, 2}}, {config.model.past_frames});
    Profile profile;
    StepContext context{0, at::detail::createCPUGenerator(1), &profile};
    terms = stage.loss(batch, context);
  }

  Dataset dataset;
  Character character;
  EgNetStage stage;
  Batch batch;
  LossTerms terms;
};

using EgNetStageRecovers = EgNetTraining;
using EgNetStageReference = EgNetTraining;
using EgNetStageRejects = EgNetTraining;

TEST_F(EgNetStageRecovers, LossFallsAndTheTrainedModelLoads) {
  const RunFolder run(*folder_ / "falls");
  const auto summary = train(run);
  EXPECT_EQ(summary.reason, StopReason::finished);
  const auto metrics = read_metrics(run.metrics());
  EXPECT_LT(metrics.back().loss, 0.7 * metrics.front().loss);
  std::vector<std::string> parts, terms;
  for (const auto& part : metrics[0].milliseconds) parts.push_back(part.first);
  for (const auto& term : metrics[0].terms) terms.push_back(term.name);
  EXPECT_THAT(parts, ::testing::UnorderedElementsAre("load", "network", "layers", "boundary", "silhouette", "arap",
                                                     "backward", "optimiser"));
  EXPECT_THAT(terms, ::testing::UnorderedElementsAre("model_to_data", "data_to_model", "arap"));
  EXPECT_TRUE(std::filesystem::exists(run.images() / "overlay-test.jpg"));
  EXPECT_TRUE(std::filesystem::exists(run.images() / "overlay-train.jpg"));

  TrainedActor trained = TrainedActor::load(run.path());
  EXPECT_EQ(trained.steps.at("egnet"), 40);
  const Dataset dataset = Dataset::open(prepared_);
  const SampleId sample = dataset.samples(Split::test)[1];
  const auto window = dataset.dof_window(sample, trained.past_frames()).unsqueeze(0);
  const auto moved = trained.coarse(window) - trained.surface->skinned_by_nodes(window.select(1, -1).contiguous());
  EXPECT_GT(moved.abs().max().item<float>(), 1e-3f);
  EXPECT_TRUE(torch::isfinite(moved).all().item<bool>());

  // The rate of the motion windows is that of the training, whatever another capture has.
  const auto faster = prepared_.parent_path() / "faster";
  std::filesystem::copy(prepared_, faster, std::filesystem::copy_options::recursive);
  Capture capture = read_capture(faster);
  const double rate = std::exchange(capture.fps, 2.0 * capture.fps);
  write_capture(capture.file, capture);
  EXPECT_EQ(TrainedActor::load(run.path(), faster).frames_per_second, rate);
}

TEST_F(EgNetStageRecovers, StoppedAnywhereEqualsAnUnbrokenRunToTheBit) {
  const RunFolder whole(*folder_ / "whole"), broken(*folder_ / "broken");
  train(whole);
  for (const std::int64_t stop : {3, 8, 21, 40}) train(broken, stop);
  const auto expected = CheckpointFolder(whole.checkpoints()).load_latest()->second;
  const auto actual = CheckpointFolder(broken.checkpoints()).load_latest()->second;
  ASSERT_EQ(expected.tensors().size(), actual.tensors().size());
  for (const auto& [name, tensor] : expected.tensors()) EXPECT_TRUE(torch::equal(tensor, actual.tensor(name))) << name;
  EXPECT_EQ(expected.text("data"), actual.text("data"));
}

TEST_F(EgNetStageReference, UntrainedLossIsThatOfTheSkinnedTemplate) {
  const EgNetRunConfig c = config({"data.input_noise=0", "data.pose_noise=0", "model.head_scale=0"});
  const FirstLoss first(c);
  const auto& [dataset, character, stage, batch, terms] = first;
  const auto vertices = CharacterSurface(character)->skinned_by_nodes(batch.dofs.select(1, -1).contiguous());
  const auto expected = silhouette_loss(vertices, face_tensor(character.mesh),
                                        SilhouetteTarget{batch.projection, batch.distance, batch.pixel_scale,
                                                         batch.valid, batch.contour, batch.contour_offsets},
                                        c.silhouette);
  EXPECT_NEAR(terms[0].value.item<double>(), expected.model_to_data.item<double>(), 1e-6);
  EXPECT_NEAR(terms[1].value.item<double>(), expected.data_to_model.item<double>(), 1e-4);
  EXPECT_EQ(terms[2].value.item<double>(), 0.0);
  EXPECT_GT(terms[0].value.item<double>(), 0.0);
}

TEST_F(EgNetStageReference, TheAnchorMeasuresTheDistanceFromTheSkinnedTemplate) {
  FirstLoss first(config({"data.input_noise=0", "data.pose_noise=0", "loss.anchor=1e4"}));
  auto& [dataset, character, stage, batch, terms] = first;
  CharacterSurface surface(character);
  const auto dofs = batch.dofs.select(1, -1).contiguous();
  const auto [A, T] = stage.network()->forward(batch.dofs);
  const auto moved = surface->deformed(dofs, A, T) - surface->skinned(dofs);
  ASSERT_EQ(terms.back().name, "anchor");
  EXPECT_EQ(terms.back().weight, 1e4);
  EXPECT_GT(terms.back().value.item<double>(), 0.0);
  EXPECT_NEAR(terms.back().value.item<double>() / moved.square().sum(-1).mean().item<double>(), 1.0, 1e-4);
}

TEST_F(EgNetStageReference, ValidationFramesAreSetAsideByShareOrByName) {
  const EgNetRunConfig c = config({"validation.share=0.25"});
  const Dataset dataset = c.subject.open_dataset(), all = Dataset::open(c.subject.capture);
  const std::size_t count = all.samples(Split::train).size(), held = dataset.samples(Split::validation).size();
  EXPECT_EQ(held, count / 4);
  EXPECT_EQ(dataset.samples(Split::train).size(), count - held);
  EXPECT_EQ(dataset.samples(Split::validation).back().frame, all.samples(Split::train).back().frame);
  EXPECT_EQ(dataset.samples(Split::test), all.samples(Split::test));

  const auto named = [](const std::string& sequences) {
    Dataset other = Dataset::open(prepared_);
    other.hold_out({{sequences}, {}, 0.0});
    return other;
  };
  EXPECT_THAT(support::message_of<UsageError>([&] { named("run"); }), HasSubstr("it has walk"));
  EXPECT_THAT(support::message_of<UsageError>([&] { named("dance"); }), HasSubstr("no training sequence \"dance\""));
  EXPECT_THAT(support::message_of<UsageError>([&] { named("walk"); }), HasSubstr("leave at least one"));
}

TEST_F(EgNetStageReference, ValidationLossIsTheLossWithoutNoiseOnValidationFrames) {
  const EgNetRunConfig c = config({"validation.share=0.25"});
  const Dataset dataset = c.subject.open_dataset();
  const Character character = load_character(dataset.character_path(), c.subject.character);
  EgNetStage stage(dataset, character, c);
  stage.model().eval();
  const std::vector<int> cameras = dataset.camera_indices({});
  EXPECT_THAT(support::message_of<UsageError>([&] { dataset.camera_indices({"c0", "c0"}); }), HasSubstr("named twice"));
  double sum = 0.0;
  for (const SampleId& sample : dataset.samples(Split::validation)) {
    Profile profile;
    StepContext context{0, at::detail::createCPUGenerator(99), &profile};
    for (const LossTerm& term : stage.loss(make_batch(dataset, {sample}, {cameras}, {c.loader.past_frames}), context))
      sum += term.weight * term.value.item<double>();
  }
  const double expected = sum / static_cast<double>(dataset.samples(Split::validation).size());
  EXPECT_GT(expected, 0.0);
  EXPECT_NEAR(*stage.validation_loss(7), expected, 1e-6 * expected);
  const Dataset without = Dataset::open(prepared_);
  EXPECT_FALSE(EgNetStage(without, character, config()).validation_loss(7));
}

TEST_F(EgNetStageReference, EvaluationStatisticsAreThoseOfAllTrainingFrames) {
  const EgNetRunConfig c = config({"model.rotation=euler"});
  const Dataset dataset = Dataset::open(c.subject.capture);
  const Character character = load_character(dataset.character_path(), c.subject.character);
  EgNetStage stage(dataset, character, c);
  std::vector<torch::Tensor> windows;
  for (const SampleId& sample : dataset.samples(Split::train))
    windows.push_back(dataset.dof_window(sample, c.model.past_frames));
  torch::NoGradGuard no_grad;
  stage.model().train();
  stage.prepare_evaluation();
  const auto in_training = stage.network()->forward(torch::stack(windows)).second;
  stage.prepare_evaluation();  // the pass above moved the running statistics
  stage.model().eval();
  const auto in_evaluation = stage.network()->forward(torch::stack(windows)).second;
  // Running variances are unbiased, n/(n-1) larger than what training divides by: 12 frames make 4 % of the features,
  // less of T.
  EXPECT_LT((in_training - in_evaluation).abs().max().item<float>(), 0.2f * in_training.abs().max().item<float>());
}

TEST_F(EgNetStageRejects, WrongConfigurations) {
  EXPECT_THROW(config({"data.batch_sise=3"}), FileError);
  EXPECT_THROW(config({"data.batch_size=0"}), FileError);
  EXPECT_THROW(config({"loss.arap=-1"}), FileError);
  EXPECT_THROW(config({"stage=posenet"}), FileError);
  EXPECT_THROW(config({"train.schedule=linear"}), FileError);
  EXPECT_THROW(EgNetRunConfig::read(ConfigDocument::parse(kConfig, "test.yaml")), UsageError);
}

TEST_F(EgNetStageRejects, LoadingWhatIsNotARun) {
  const TemporaryFolder empty;
  EXPECT_THROW(TrainedActor::load(empty.path()), Error);
  write_atomically(empty / "config.yaml", config_text());
  EXPECT_THAT(support::message_of<Error>([&] { TrainedActor::load(empty.path()); }), HasSubstr("no checkpoint"));
}

TEST(EgNetConfigReference, ShippedConfigurationsAreRead) {
  const std::filesystem::path configs = std::filesystem::path(DOPPEL_SOURCE_DIR) / "configs";
  const auto quickstart =
      EgNetRunConfig::read(ConfigDocument::load(configs / "quickstart/egnet.yaml", {"capture=/somewhere"}));
  EXPECT_EQ(quickstart.subject.capture, "/somewhere");
  EXPECT_EQ(quickstart.silhouette_weight, 100.0);
  const auto chain = StageChain::read(ConfigDocument::load(configs / "paper/ddc.yaml", {"capture=/somewhere"}));
  const auto paper = EgNetRunConfig::read(chain.stage("egnet"));
  EXPECT_EQ(paper.subject.capture, "/somewhere");
  EXPECT_EQ(paper.silhouette_weight, 100.0);
  EXPECT_EQ(paper.arap_weight, 1500.0);
  EXPECT_EQ(paper.trainer.iterations, 360000);
  EXPECT_EQ(paper.loader.batch_size, 40);
  EXPECT_EQ(paper.loader.cameras_per_sample, 40);
  EXPECT_EQ(paper.trainer.schedule.rate(359999), 1e-4);
  EXPECT_EQ(paper.model.sagcn.rings, 3);
}

}  // namespace
}  // namespace doppel::egnet_stage_test
