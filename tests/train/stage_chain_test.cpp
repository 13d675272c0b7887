#include "doppel/train/stage_chain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "doppel/actor/draw.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/losses/images.h"
#include "doppel/train/delta_net_stage.h"
#include "doppel/train/lighting_stage.h"
#include "doppel/train/stage_table.h"
#include "doppel/train/tex_net_stage.h"
#include "support/message_of.h"
#include "support/same_run.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::stage_chain_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr char kChain[] = R"(stage: ddc
egnet:
  data: {batch_size: 4, cameras_per_sample: 2}
  model: {features: 4, residual_blocks: 2, rings: 2}
  train: {iterations: 12, learning_rate: 0.005, log_every: 4, checkpoint_every: 8}
lighting:
  data: {batch_size: 2, image_size: 48}
  train: {iterations: 150, learning_rate: 0.03, schedule: cosine, log_every: 10}
deltanet:
  data: {batch_size: 2, cameras_per_sample: 2, image_size: 48, pose_noise: 0.01}
  model: {features: 4, residual_blocks: 2, rings: 2}
  train: {iterations: 12, learning_rate: 0.002, log_every: 4, checkpoint_every: 5, mean_weights: 0.9}
texnet:
  data: {batch_size: 2, image_size: 48, pose_noise: 0.01}
  model: {size: 256, levels: 4, width: 0.1, dropout: 0.5, camera_centre: root_relative, residual: true, lit: true, surface_normals: true}
  loss: {distance: squares}
  train: {iterations: 8, learning_rate: 0.002, log_every: 2, checkpoint_every: 3}
gaussians:
  data: {batch_size: 2, image_size: 48}
  model: {size: 64, levels: 4, width: 0.1, lit: true}
  train: {iterations: 8, learning_rate: 0.001, log_every: 2, checkpoint_every: 3}
)";

StageChain chain_of(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return StageChain::read(ConfigDocument::parse(text, "chain.yaml", overrides));
}

/// A capture and a trained chain that all tests here share.
class Chain : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    SmallCaptureOptions options;
    options.textured = true;
    prepared_ = make_small_capture(*folder_ / "capture", options);
    summaries_ = train_stages(chain(), *folder_ / "run", {});
  }
  static void TearDownTestSuite() { delete folder_; }

  static StageChain chain(const std::vector<std::string>& overrides = {}) {
    return chain_of("capture: " + prepared_.string() + "\n" + kChain, overrides);
  }
  static TemporaryFolder* folder_;
  static fs::path prepared_;
  static std::vector<StageSummary> summaries_;
};
TemporaryFolder* Chain::folder_ = nullptr;
fs::path Chain::prepared_;
std::vector<StageSummary> Chain::summaries_;

using StageChainRecovers = Chain;
using StageChainReference = Chain;
using StageChainRejects = Chain;

TEST_F(StageChainReference, TrainsEveryStageInItsOwnFolderAndReportsThemTogether) {
  ASSERT_EQ(summaries_.size(), 5u);
  for (const StageSummary& item : summaries_) {
    EXPECT_EQ(item.summary.reason, StopReason::finished);
    EXPECT_TRUE(fs::exists(RunFolder(*folder_ / "run" / item.stage).report())) << item.stage;
  }
  const std::string report = read_file(*folder_ / "run" / "report.html");
  for (const std::string& name : ddc_stages()) EXPECT_THAT(report, HasSubstr("<h1>" + name + "</h1>"));
  EXPECT_THAT(report, HasSubstr("dynamic texture and its error"));
}

TEST_F(StageChainReference, MemoryOfEveryStageStaysFlat) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer keeps freed memory";
#endif
  setup_process();                 // as the program does: freed memory stays, so that what is held is what was needed
  const double allowed_mb = 24.0;  // the heap itself varies by a few; the tensors of one step kept 40 times are more
  std::vector<std::string> longer;
  for (const std::string& name : ddc_stages()) {
    longer.push_back(name + ".train.iterations=80");
    longer.push_back(name + ".train.log_every=10");
    longer.push_back(name + ".train.checkpoint_every=80");
  }
  train_stages(chain(longer), *folder_ / "long", {});
  for (const std::string& name : ddc_stages()) {
    const std::vector<MetricsRecord> metrics = read_metrics(*folder_ / "long" / name / "metrics.jsonl");
    ASSERT_EQ(metrics.size(), 8u) << name;
    EXPECT_GT(metrics.front().memory_mb, 0.0);
    const double first_half = std::max(metrics[1].memory_mb, std::max(metrics[2].memory_mb, metrics[3].memory_mb));
    EXPECT_LT(metrics.back().memory_mb, first_half + allowed_mb) << name;
    RecordProperty(name + "_mb", static_cast<int>(metrics.back().memory_mb));
  }
}

TEST_F(StageChainReference, ASecondCallFindsEverythingDone) {
  for (const StageSummary& item : train_stages(chain(), *folder_ / "run", {}))
    EXPECT_EQ(item.summary.resumed_at, item.summary.step) << item.stage;
}

TEST_F(StageChainReference, TheTrainedActorHasWhatWasTrained) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run");
  ASSERT_TRUE(actor.lighting && actor.deltanet && actor.texnet && actor.gaussians);
  const Dataset dataset = Dataset::open(prepared_);
  BatchOptions options;
  options.past_frames = actor.past_frames();
  options.images = true;
  const Batch batch = make_batch(dataset, {dataset.samples(Split::test)[2]}, {{1}}, options);
  const torch::Tensor coarse = actor.coarse(batch.dofs), fine = actor.fine(batch.dofs);
  EXPECT_GT((fine - coarse).abs().max().item<float>(), 1e-6f);
  const torch::Tensor texture = actor.texture(batch.dofs, batch.image_projection.select(1, 0));
  EXPECT_EQ(texture.sizes(), torch::IntArrayRef({1, 256, 256, 3}));
  EXPECT_GE(texture.min().item<float>(), 0.0f);
  EXPECT_LE(texture.max().item<float>(), 1.0f);
  EXPECT_FALSE(texture.requires_grad());
}

std::string config_of(const fs::path& run) { return read_file(run / "config.yaml"); }

TEST_F(StageChainRejects, AnotherConfigurationAndLeavesTheRunAsItWas) {
  const fs::path run = *folder_ / "run";
  const std::string before = config_of(run), of_egnet = config_of(run / "egnet");
  EXPECT_THAT(message_of<UsageError>([&] { train_stages(chain({"validation.share=0.25"}), run, {}); }),
              HasSubstr("another configuration"));
  EXPECT_EQ(config_of(run), before);
  EXPECT_EQ(config_of(run / "egnet"), of_egnet);
  EXPECT_THAT(message_of<UsageError>([&] { train_stages(chain({"deltanet.train.learning_rate=0.5"}), run, {}); }),
              HasSubstr("another configuration"));
  EXPECT_EQ(config_of(run), before) << "a later stage refused";
  SmallCaptureOptions other;
  other.textured = true;
  other.thickness = 0.06;
  const fs::path recording = make_small_capture(*folder_ / "again", other);
  EXPECT_THAT(message_of<UsageError>([&] { train_stages(chain({"capture=" + recording.string()}), run, {}); }),
              HasSubstr("another recording"));
  EXPECT_EQ(config_of(run), before);
  EXPECT_EQ(config_of(run / "egnet"), of_egnet);
  const fs::path fresh = *folder_ / "fresh";
  EXPECT_THAT(message_of<Error>([&] { train_stages(chain({"egnet={run: " + recording.string() + "}"}), fresh, {}); }),
              HasSubstr("again"));
  EXPECT_FALSE(fs::exists(fresh / "config.yaml"));
}

TEST_F(StageChainReference, AChainOfOtherRunsAloneIsARun) {
  std::vector<std::string> borrowed;
  for (const std::string& stage : ddc_stages())
    borrowed.push_back(stage + "={run: " + (*folder_ / "run").string() + "}");
  EXPECT_TRUE(train_stages(chain(borrowed), *folder_ / "borrowed", {}).empty());
  EXPECT_TRUE(TrainedActor::load(*folder_ / "borrowed").gaussians);
}

TEST_F(StageChainReference, AnEgNetThatWasTrainedAgainIsAWarning) {
  const fs::path run = *folder_ / "again_trained";
  fs::copy(*folder_ / "run", run, fs::copy_options::recursive);
  const auto warning = [&] {
    ::testing::internal::CaptureStdout();  // where the logger of tests writes
    TrainedActor::load(run);
    return ::testing::internal::GetCapturedStdout();
  };
  EXPECT_THAT(warning(), ::testing::Not(HasSubstr("was trained on another")));
  ChainOptions options;
  options.stages = {"egnet"};
  options.mode = RunMode::overwrite;
  train_stages(chain({"egnet.train.iterations=3"}), run, options);
  EXPECT_THAT(warning(), HasSubstr("deltanet was trained on another egnet"));
}

TEST_F(StageChainRejects, RunsThatNameThemselves) {
  const fs::path run = *folder_ / "run";
  EXPECT_THAT(message_of<UsageError>([&] { train_stages(chain({"egnet={run: " + run.string() + "}"}), run, {}); }),
              HasSubstr("names this folder itself"));
  const auto borrow = [&](const std::string& from, const std::string& name) {
    write_atomically(*folder_ / name / "config.yaml", "stage: ddc\negnet: {run: " + (*folder_ / from).string() + "}\n");
  };
  borrow("a", "b");
  borrow("b", "a");
  EXPECT_THAT(message_of<Error>([&] { stage_folder(*folder_ / "a", "egnet"); }), HasSubstr("in a circle"));
}

TEST_F(StageChainReference, AChainThatStoppedInItsFirstStageResumes) {
  const std::vector<std::string> short_chain{"lighting.train.iterations=2", "deltanet.train.iterations=1"};
  ChainOptions options;
  options.stages = {"egnet"};
  train_stages(chain(short_chain), *folder_ / "stopped", options);
  options.stages = {"egnet", "lighting"};
  options.mode = RunMode::resume;
  EXPECT_EQ(train_stages(chain(short_chain), *folder_ / "stopped", options).size(), 2u);
  EXPECT_THAT(message_of<UsageError>([&] { train_stages(chain(short_chain), *folder_ / "new", options); }),
              HasSubstr("no checkpoint"));
}

TEST_F(StageChainRejects, ATextureUnderLightThatNobodyLearnt) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run");
  const TexNetConfig config = actor.texnet->config();
  const at::Generator generator = at::detail::createCPUGenerator(1);
  actor.lighting = nullptr;
  EXPECT_THAT(message_of([&] { make_tex_net(actor, config, generator); }), HasSubstr("`lighting`"));
  actor.static_texture = torch::Tensor();
  EXPECT_THAT(message_of([&] { make_tex_net(actor, config, generator); }), HasSubstr("texture"));
}

/// How well the light of the skinned template's images is found: an EGNet that does not move anything leaves only
/// the light to learn.
class LightingStageRecovers : public ::testing::Test {
 protected:
  void SetUp() override {
    SmallCaptureOptions options;
    options.textured = true;
    options.thickness = 0;
    capture_ = make_small_capture(folder_ / "capture", options).string();
  }
  /// Trains the light. @param section more of its configuration @return mean error of the colours drawn in a camera
  float error(const std::string& section, int camera) {
    const std::string still =
        "model: {features: 4, residual_blocks: 2, rings: 2, head_scale: 0}, train: {iterations: 1, learning_rate: 0}";
    const fs::path run = folder_ / ("run" + std::to_string(runs_++));
    train_stages(chain_of("capture: " + capture_ + "\nstage: ddc\negnet: {" + still + "}\nlighting: {" + section +
                          ", train: {iterations: 400, learning_rate: 0.03, schedule: cosine}}\n"),
                 run, {});
    TrainedActor actor = TrainedActor::load(run);
    const Dataset dataset = Dataset::open(capture_);
    BatchOptions options;
    options.past_frames = actor.past_frames();
    options.images = true;
    const Batch batch = make_batch(dataset, {dataset.samples(Split::train)[5]}, {{camera}}, options);
    const auto draw = [&](const torch::Tensor& light) {
      return shade(actor.coarse(batch.dofs), actor.static_texture, light, batch.image_projection, *actor.mesh, 96, 96);
    };
    const ShadedImage expected = draw(small_capture::true_light().expand({1, 1, 3, 9}).contiguous());
    const auto compare = [&](const torch::Tensor& light) {
      const torch::Tensor difference = (draw(light).colour - expected.colour).abs();
      return difference.masked_select(expected.mask.unsqueeze(4)).mean().item<float>();
    };
    unlit_ = compare(identity_lighting().expand({1, 1, 3, 9}).contiguous());
    return compare(actor.lighting->forward(batch.cameras));
  }
  float unlit_ = 0.0f;  ///< the error without any learnt light

 private:
  TemporaryFolder folder_;
  std::string capture_;
  int runs_ = 0;
};

TEST_F(LightingStageRecovers, TheLightOfTheImages) {
  // One camera sees half of the normals, which leaves mixtures of coefficients open; what it sees must be right.
  const float learnt = error("data: {batch_size: 4}", 2);
  EXPECT_LT(learnt, 0.015f);
  EXPECT_LT(learnt, 0.15f * unlit_);
}

TEST_F(LightingStageRecovers, TheLightOfANewCameraFromThoseThatAreHeldTogether) {
  const std::string two = "data: {batch_size: 4, cameras: [c0, c1]}";
  const float alone = error(two, 2), together = error(two + ", loss: {deviation: 3000}", 2);
  EXPECT_LT(together, 0.5f * alone);
}

TEST_F(StageChainRecovers, DeltaNetAndTexNetResumedEqualAnUnbrokenRunToTheBit) {
  const StageChain whole = chain();
  for (const std::string stage : {"deltanet", "texnet", "gaussians"}) {
    const fs::path resumed = *folder_ / ("resumed-" + stage);
    fs::copy(*folder_ / "run", resumed, fs::copy_options::recursive);
    fs::remove_all(resumed / stage / "checkpoints");
    fs::create_directories(resumed / stage / "checkpoints");
    const CheckpointFolder kept(*folder_ / "run" / stage / "checkpoints");
    const auto first = kept.steps().front();
    ASSERT_LT(first, kept.steps().back());
    fs::copy(kept.path(first), resumed / stage / "checkpoints");
    write_atomically(resumed / stage / "checkpoints" / "latest", kept.path(first).filename().string() + "\n");
    ChainOptions options;
    options.stages = {stage};
    const auto summaries = train_stages(whole, resumed, options);
    EXPECT_EQ(summaries.at(0).summary.resumed_at, first);
    support::expect_same_run(*folder_ / "run" / stage, resumed / stage);
  }
}

TEST_F(StageChainReference, AFileOfOneStageTrainsIntoTheFolderItself) {
  const std::string text = "stage: egnet\ncapture: " + prepared_.string() +
                           "\nmodel: {features: 4, residual_blocks: 2, rings: 2}\ntrain: {iterations: 3}\n";
  const fs::path run = *folder_ / "single";
  EXPECT_EQ(train_stages(chain_of(text), run, {}).at(0).summary.step, 3);
  EXPECT_EQ(train_stages(chain_of(text), run, {}).at(0).summary.resumed_at, 3);
  EXPECT_EQ(TrainedActor::load(run).steps.at("egnet"), 3);
  EXPECT_TRUE(fs::exists(run / "report.html"));
}

TEST_F(StageChainReference, AStageCanComeFromAnotherRun) {
  const std::string run = (*folder_ / "run").string();
  const auto summaries =
      train_stages(chain({"egnet={run: " + run + "}", "lighting={run: " + run + "}", "deltanet.train.iterations=2",
                          "texnet={run: " + run + "}", "gaussians={run: " + run + "}"}),
                   *folder_ / "borrower", {});
  ASSERT_EQ(summaries.size(), 1u);
  EXPECT_EQ(summaries[0].stage, "deltanet");
  EXPECT_EQ(TrainedActor::load(*folder_ / "borrower").steps.at("egnet"), 12);
}

TEST_F(StageChainRecovers, TheImagesByGaussiansOnTheStagesOfAnotherRun) {
  const fs::path out = *folder_ / "gaussians";
  const std::string text =
      "stage: ddc\ncapture: " + prepared_.string() + "\nddc: " + (*folder_ / "run").string() +
      "\ngaussians:\n  data: {batch_size: 4, image_size: 48}\n  model: {size: 64, network: false}\n"
      "  train: {iterations: 120, learning_rate: 2e-3, schedule: cosine, log_every: 10}\n";
  const auto summaries = train_stages(chain_of(text), out, {});
  ASSERT_EQ(summaries.size(), 1u);
  EXPECT_EQ(summaries[0].stage, "gaussians");
  const std::vector<MetricsRecord> metrics = read_metrics(out / "gaussians" / "metrics.jsonl");
  EXPECT_LT(metrics.back().loss, 0.8 * metrics.front().loss);

  TrainedActor actor = TrainedActor::load(out);
  const Dataset dataset = Dataset::open(prepared_);
  BatchOptions options;
  options.past_frames = actor.past_frames();
  options.images = true;
  const Batch batch = make_batch(dataset, {dataset.samples(Split::train)[2]}, {{0}}, options);
  const std::int64_t size = batch.image.size(2);
  const torch::Tensor vertices = actor.fine(batch.dofs), projection = batch.image_projection.select(1, 0);
  const SplatImage drawn = draw_gaussians(actor, batch.dofs, projection, vertices, size, size);
  const torch::Tensor mask = batch.image_mask.gt(0), covered = drawn.alpha > 0.5;
  const double overlap = (mask & covered).sum().item<double>() / (mask | covered).sum().item<double>();
  EXPECT_GT(overlap, 0.8);  // of images of 48 pixels, where the outline is a tenth of the person
  const torch::Tensor image = image_float(batch.image) * mask.unsqueeze(4);
  const ShadedImage textured =
      draw(*actor.mesh, vertices, static_appearance(actor), batch.image_projection, size, size);
  EXPECT_LT((drawn.colour - image).abs().mean().item<double>(), (textured.colour - image).abs().mean().item<double>());
}

TEST_F(StageChainRecovers, DeltaNetIsNearerToTheTrueSurfaceThanEgNet) {
  const std::string run = (*folder_ / "run").string();
  const fs::path out = *folder_ / "nearer";
  ChainOptions options;
  options.stages = {"deltanet"};
  train_stages(chain({"egnet={run: " + run + "}", "lighting={run: " + run + "}", "deltanet.train.iterations=60",
                      "deltanet.train.mean_weights=0", "deltanet.loss={chroma: 0}"}),
               out, options);
  TrainedActor actor = TrainedActor::load(out, std::nullopt, "texnet");
  const Dataset dataset = Dataset::open(prepared_);
  const NpyArray stored = read_npy(*folder_ / "capture/ground_truth/walk/vertices.npy");
  const torch::Tensor true_surface = torch::tensor(stored.as<float>()).view(stored.shape);
  double egnet = 0.0, deltanet = 0.0;
  for (const SampleId& sample : dataset.samples(Split::train)) {
    const torch::Tensor window = dataset.dof_window(sample, actor.past_frames()).unsqueeze(0);
    const auto distance = [&](const torch::Tensor& vertices) {
      return (vertices[0] - true_surface[sample.frame]).norm(2, 1).mean().item<double>();
    };
    egnet += distance(actor.coarse(window));
    deltanet += distance(actor.fine(window));
  }
  EXPECT_LT(deltanet, 0.95 * egnet) << "the true surface is 2 cm thicker than the template, as the masks show";
}

TEST_F(StageChainRecovers, AnAnchorKeepsVerticesNearEgNetsSurface) {
  const std::string run = (*folder_ / "run").string();
  const auto squared_distance = [&](const std::string& anchor) {
    const fs::path out = *folder_ / ("anchor-" + anchor);
    ChainOptions options;
    options.stages = {"deltanet"};
    train_stages(chain({"egnet={run: " + run + "}", "lighting={run: " + run + "}", "deltanet.train.iterations=30",
                        "deltanet.loss={anchor: " + anchor + "}"}),
                 out, options);
    TrainedActor actor = TrainedActor::load(out, std::nullopt, "texnet");
    const Dataset dataset = Dataset::open(prepared_);
    const torch::Tensor window =
        dataset.dof_window(dataset.samples(Split::train).front(), actor.past_frames()).unsqueeze(0);
    return (actor.fine(window) - actor.coarse(window)).square().sum(2).mean().item<double>();
  };
  EXPECT_LT(squared_distance("1e7"), 0.5 * squared_distance("0"));
}

TEST_F(StageChainRejects, ALaterStageOnOtherWeightsThanItWasTrainedOn) {
  const fs::path run = *folder_ / "changed";
  fs::copy(*folder_ / "run", run, fs::copy_options::recursive);
  ChainOptions overwrite;
  overwrite.stages = {"egnet"};
  overwrite.mode = RunMode::overwrite;
  train_stages(chain({"egnet.train.iterations=3"}), run, overwrite);
  ChainOptions later;
  later.stages = {"deltanet"};
  EXPECT_THAT(message_of([&] { train_stages(chain({"egnet.train.iterations=3"}), run, later); }),
              AllOf(HasSubstr("was trained on other data"), HasSubstr("egnet")));
}

TEST_F(StageChainRejects, MistakesWithFileAndLine) {
  EXPECT_THAT(message_of([] { chain({"deltanet.los.chroma=1"}); }), AllOf(HasSubstr("los"), HasSubstr("loss")));
  EXPECT_THAT(message_of([] { chain({"detlanet.loss.chroma=1"}); }), HasSubstr("did you mean deltanet?"));
  EXPECT_THAT(message_of([] { chain_of("capture: x\nseed: 1\nstage: ddc\negnet:\n  seed: 3\n"); }),
              HasSubstr("chain.yaml:5"));
  EXPECT_THAT(message_of([] { chain_of("capture: x\nstage: ddc\ndeltanet: {}\n"); }), HasSubstr("egnet"));
  EXPECT_THAT(message_of([] { chain({"texnet.data.cameras_per_sample=2"}); }), HasSubstr("only 1 is allowed"));
  EXPECT_THAT(message_of([] { chain({"texnet.model.size=300"}); }), HasSubstr("power of two"));
  EXPECT_THAT(message_of([] { chain({"gaussians.data.cameras_per_sample=2"}); }), HasSubstr("only 1 is allowed"));
  EXPECT_THAT(message_of([] { chain({"gaussians.model.size=300"}); }), HasSubstr("power of two"));
  EXPECT_THAT(message_of([] { chain({"texnet.model.residual=false"}); }), HasSubstr("residual: true"));
  EXPECT_THAT(message_of([] { chain({"texnet.loss.distance=square"}); }), HasSubstr("squares"));
  for (const std::string stage : {"egnet", "deltanet"}) {
    const std::string outline = stage + ".loss.boundary=outline";
    EXPECT_THAT(message_of([&] {
                  chain({outline, stage + ".loss.visible_only=true"});
                }),
                AllOf(HasSubstr("visible_only"), HasSubstr("set boundary: vertices")));
    EXPECT_THAT(message_of([&] {
                  chain({outline, stage + ".loss.unit=image_pixels"});
                }),
                AllOf(HasSubstr("unit"), HasSubstr("leave the key out")));
    EXPECT_NO_THROW(chain({outline, stage + ".loss.unit=crop_pixels", stage + ".loss.visible_only=false"})) << stage;
    EXPECT_THAT(message_of([&] { chain({stage + ".model.network=fully_connected"}); }),
                AllOf(HasSubstr("model.features"), HasSubstr("does not read this key")));
  }
  EXPECT_THAT(message_of([] { stage_entry("deltnet"); }), HasSubstr("did you mean deltanet?"));
}

TEST_F(StageChainRejects, StagesThatAreMissing) {
  ChainOptions options;
  options.stages = {"deltanet"};
  EXPECT_THAT(message_of([&] { train_stages(chain(), *folder_ / "nothing", options); }),
              HasSubstr("no checkpoint of egnet"));
  const StageChain without = chain_of("capture: " + prepared_.string() + "\nstage: ddc\negnet: {}\n");
  EXPECT_THAT(message_of([&] { train_stages(without, *folder_ / "none", options); }),
              HasSubstr("no section `deltanet`"));
  const std::string run = (*folder_ / "run").string();
  const std::string dark = "capture: " + prepared_.string() + "\nstage: ddc\negnet: {run: " + run + "}\ndeltanet: {}\n";
  EXPECT_THAT(message_of([&] { train_stages(chain_of(dark), *folder_ / "dark", {}); }), HasSubstr("loss.lit"));
}

TEST(StageChainConfigReference, ShippedConfigurationsAreRead) {
  for (const std::string size : {"tiny", "small", "paper"}) {
    const auto path = fs::path(DOPPEL_SOURCE_DIR) / "configs" / size / "ddc.yaml";
    const StageChain chain = StageChain::read(ConfigDocument::load(path, {"capture=/somewhere"}));
    EXPECT_EQ(chain.capture(), "/somewhere");
    for (const std::string& stage : ddc_stages())
      EXPECT_EQ(chain.has(stage), stage != "gaussians") << size << " " << stage;
  }
  for (const std::string size : {"tiny", "small"}) {
    const auto path = fs::path(DOPPEL_SOURCE_DIR) / "configs" / size / "gaussians.yaml";
    const StageChain chain = StageChain::read(ConfigDocument::load(path, {"capture=/somewhere", "ddc=/run"}));
    for (const std::string& stage : ddc_stages()) EXPECT_TRUE(chain.has(stage)) << size << " " << stage;
    EXPECT_FALSE(chain.borrowed("gaussians"));
    EXPECT_TRUE(chain.borrowed("texnet"));
  }
  const StageChain paper = StageChain::read(
      ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/paper/ddc.yaml", {"capture=/somewhere"}));
  const auto delta = DeltaNetRunConfig::read(paper.stage("deltanet"));
  EXPECT_EQ(delta.chroma_weight, 0.03775);
  EXPECT_EQ(delta.silhouette_weight, 500.0);
  EXPECT_EQ(delta.laplacian_weight, 1e5);
  EXPECT_EQ(delta.trainer.iterations, 360000);
  EXPECT_EQ(LightingRunConfig::read(paper.stage("lighting")).trainer.iterations, 30000);
  EXPECT_EQ(TexNetRunConfig::read(paper.stage("texnet")).loader.batch_size, 12);
}

}  // namespace
}  // namespace doppel::stage_chain_test
