#include "doppel/train/hybrid_stage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/train/nerf_stage.h"
#include "doppel/train/stage_chain.h"
#include "support/message_of.h"
#include "support/same_run.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::hybrid_stage_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;
namespace fs = std::filesystem;

HybridPlan plan_of(const std::string& text) {
  return read_options<HybridPlan>(ConfigDocument::parse(text, "c.yaml").root());
}

TEST(HybridPlanReference, IsTheThesissWhereTheConfigurationIsSilent) {
  const HybridPlan plan = plan_of("{}");
  EXPECT_EQ(plan.iterations(), 110000 + 400 + 500000 + 400);
  EXPECT_EQ(plan.at(0).phase, HybridPhase::field);
  EXPECT_EQ(plan.at(109999).phase, HybridPhase::field);
  EXPECT_EQ(plan.at(110000).phase, HybridPhase::refine);
  EXPECT_EQ(plan.at(110400).phase, HybridPhase::field);
  EXPECT_EQ(plan.at(0).variance, 0.01);
  EXPECT_EQ(plan.at(110400).variance, 0.1);
}

TEST(HybridPlanReference, RoundsFollowEachOtherAndEachPhaseFallsFromItsRate) {
  const HybridPlan plan = plan_of(
      "rounds: [{field: 10, refine: 4, variance: 1}, {field: 0, refine: 2, variance: 2}]\n"
      "joint: 3\nrates: {field: 0.1, refine: 0.01, joint: 0.001, final_ratio: 0.5}\n");
  EXPECT_EQ(plan.iterations(), 19);
  const auto phase = [&](std::int64_t step) { return plan.at(step).phase; };
  EXPECT_EQ(phase(9), HybridPhase::field);
  EXPECT_EQ(phase(10), HybridPhase::refine);
  EXPECT_EQ(phase(15), HybridPhase::refine);
  EXPECT_EQ(phase(16), HybridPhase::joint);
  EXPECT_EQ(plan.at(14).variance, 2.0);
  EXPECT_EQ(plan.at(18).variance, 2.0);
  for (std::int64_t step = 0; step < 19; ++step)
    EXPECT_EQ(plan.at(step).first, step == 0 || step == 10 || step == 14 || step == 16) << step;
  const Schedule schedule = plan.schedule();
  EXPECT_DOUBLE_EQ(schedule.rate(0), 0.1);
  EXPECT_DOUBLE_EQ(schedule.rate(5), 0.075);
  EXPECT_DOUBLE_EQ(schedule.rate(10), 0.01);
  EXPECT_DOUBLE_EQ(schedule.rate(12), 0.0075);
  EXPECT_DOUBLE_EQ(schedule.rate(16), 0.001);
  EXPECT_DOUBLE_EQ(schedule.rate(100), 0.0005);
}

TEST(HybridPlanRejects, NothingToTrain) {
  EXPECT_THAT(message_of([] { plan_of("rounds: [{field: 0, refine: 0}]\n"); }), HasSubstr("c.yaml:1"));
  EXPECT_THAT(message_of([] { plan_of("{rounds: [], joint: 0}\n"); }), HasSubstr("no round has any steps"));
  EXPECT_EQ(plan_of("{rounds: [], joint: 3}\n").iterations(), 3);
}

TEST(HybridConfigurations, ThatComeAlongAreReadable) {
  for (const std::string size : {"tiny", "small", "paper"}) {
    const auto path = fs::path(DOPPEL_SOURCE_DIR) / "configs" / size / "hybrid.yaml";
    const StageChain chain = StageChain::read(ConfigDocument::load(path, {"capture=/somewhere", "ddc=/elsewhere"}));
    EXPECT_TRUE(chain.borrowed("egnet") && chain.borrowed("deltanet"));
    EXPECT_TRUE(chain.has("radiance") && !chain.borrowed("radiance"));
    EXPECT_FALSE(chain.has("posenet"));
  }
  const StageChain paper = StageChain::read(
      ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/paper/hybrid.yaml", {"capture=/a", "ddc=/b"}));
  const HybridRunConfig config = HybridRunConfig::read(paper.stage("radiance"));
  EXPECT_EQ(config.trainer.iterations, HybridPlan().iterations());
  EXPECT_EQ(config.rays, 1000);
  EXPECT_EQ(config.in_mask, 0.0);
  EXPECT_EQ(config.field_rays.samples, 64);
  EXPECT_EQ(config.laplacian_weight, 4000.0);
  EXPECT_EQ(config.chamfer_weight, 5000.0);
  EXPECT_EQ(config.model.motion.sagcn.features, 16);
  EXPECT_EQ(config.model.field.features, 64);
}

TEST(HybridConfigurations, ThePaperHasTheFieldWithoutAMeshAtItsPublishedSize) {
  const StageChain paper = StageChain::read(
      ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/paper/nerf.yaml", {"capture=/a", "ddc=/b"}));
  EXPECT_FALSE(paper.has("radiance"));
  const NerfRunConfig config = NerfRunConfig::read(paper.stage("nerf"));
  EXPECT_EQ(config.model.field.layers, 8);
  EXPECT_EQ(config.model.field.width, 256);
  EXPECT_EQ(config.model.field.skip, 5);
  EXPECT_EQ(config.model.field.view_width, 128);
  EXPECT_EQ(config.model.position_octaves, 10);
  EXPECT_EQ(config.model.field.direction_octaves, 4);
  EXPECT_EQ(config.model.coarse, 64);
  EXPECT_EQ(config.model.fine, 128);
}

constexpr char kChain[] = R"(stage: hybrid
egnet:
  data: {batch_size: 4, cameras_per_sample: 2}
  model: {features: 4, residual_blocks: 2, rings: 2}
  train: {iterations: 6, learning_rate: 0.002}
deltanet:
  data: {batch_size: 2, cameras_per_sample: 2}
  model: {features: 4, residual_blocks: 2, rings: 2}
  loss: {chroma: 0}
  train: {iterations: 4, learning_rate: 0.0005}
radiance:
  data: {cameras_per_sample: 2}
  model:
    motion: {features: 4, residual_blocks: 2, rings: 2}
    field: {features: 8, layers: 2, width: 32, view_width: 16}
  rays: {count: 256, samples: 16, stencil: 5, cloud: 600}
  loss: {chamfer: 3e5, silhouette: 1, laplacian: 1e5}
  rounds:
    - {field: 100, refine: 16, variance: 0.01}
    - {field: 20, refine: 10, variance: 0.1}
  joint: 4
  rates: {field: 5e-3, refine: 5e-4}
  train: {log_every: 2, checkpoint_every: 54, keep_last: 5}
nerf:
  data: {cameras_per_sample: 3, frames: [4]}
  model: {coarse: 8, fine: 8, position_octaves: 4, field: {layers: 2, width: 32, view_width: 16}}
  rays: {count: 128}
  train: {iterations: 30, learning_rate: 5e-3, log_every: 5}
)";

/// A capture and a trained hybrid that all tests here share.
class HybridTraining : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    SmallCaptureOptions options;
    options.textured = true;
    prepared_ = make_small_capture(*folder_ / "capture", options);
    train_stages(chain(), *folder_ / "run", {});
  }
  static void TearDownTestSuite() { delete folder_; }

  static StageChain chain(const std::vector<std::string>& overrides = {}) {
    return StageChain::read(
        ConfigDocument::parse("capture: " + prepared_.string() + "\n" + kChain, "chain.yaml", overrides));
  }
  static std::vector<MetricsRecord> metrics(const std::string& stage) {
    return read_metrics(*folder_ / "run" / stage / "metrics.jsonl");
  }
  /// [F,N,3]
  static Tensor vertices_of(const fs::path& file) {
    const NpyArray array = read_npy(file);
    return torch::tensor(array.as<float>()).view(array.shape);
  }
  static double term(const MetricsRecord& record, const std::string& name) {
    for (const auto& found : record.terms)
      if (found.name == name) return found.raw;
    return -1.0;
  }
  static TemporaryFolder* folder_;
  static fs::path prepared_;
};
TemporaryFolder* HybridTraining::folder_ = nullptr;
fs::path HybridTraining::prepared_;

TEST_F(HybridTraining, LearnsTheImagesAndThenBringsTheMeshToTheCloud) {
  const std::vector<MetricsRecord> records = metrics("radiance");
  ASSERT_EQ(records.size(), 75u);
  EXPECT_LT(term(records[49], "colour"), 0.25 * term(records[0], "colour"));
  EXPECT_LT(term(records[49], "mask"), 0.5 * term(records[0], "mask"));
  EXPECT_EQ(term(records[49], "chamfer"), 0.0);
  EXPECT_GT(term(records[50], "chamfer"), 0.0);
  EXPECT_LT(term(records[57], "chamfer"), term(records[50], "chamfer"));
  EXPECT_EQ(term(records[50], "colour"), 0.0);
  EXPECT_GT(term(records[74], "colour"), 0.0);  // the joint phase has both
  EXPECT_GT(term(records[74], "isometry"), 0.0);
  const std::vector<MetricsRecord> plain = metrics("nerf");
  EXPECT_LT(plain.back().loss, plain.front().loss);
}

TEST_F(HybridTraining, TheTrainedActorHasAllOfIt) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run");
  ASSERT_TRUE(actor.hybrid && actor.nerf && actor.field_viewer);
  EXPECT_EQ(actor.steps.at("radiance"), 150);
  EXPECT_EQ(actor.nerf_frame->frame, 4);
  const Dataset dataset = Dataset::open(prepared_);
  BatchOptions options;
  options.past_frames = actor.past_frames();
  options.images = true;
  const Batch batch = make_batch(dataset, {dataset.samples(Split::train)[4]}, {{1}}, options);
  // The true surface lies 2 cm outside of the template. The refined mesh is nearer to it than DeltaNet's.
  const Tensor true_surface = vertices_of(*folder_ / "capture/ground_truth/walk/vertices.npy");
  double refined = 0.0, fine = 0.0;
  for (const SampleId& sample : dataset.samples(Split::train)) {
    const Tensor window = dataset.dof_window(sample, actor.past_frames()).unsqueeze(0);
    const auto distance = [&](const Tensor& vertices) {
      return (vertices[0] - true_surface[sample.frame]).norm(2, 1).mean().item<double>() / true_surface.size(0);
    };
    refined += distance(actor.refined(window));
    fine += distance(actor.fine(window));
  }
  EXPECT_LT(refined, fine - 1e-4) << "mean distance of a vertex, metres";
  const std::int64_t size = batch.image.size(2);
  const Tensor projection = batch.image_projection[0][0];
  const FieldImage guided = actor.radiance(batch.dofs, projection, size, size);
  const Tensor mask = batch.image_mask[0][0] > 0, ground_truth = batch.image[0][0].to(torch::kFloat32) / 255.0;
  EXPECT_GT(guided.opacity.masked_select(mask).mean().item<float>(), 0.8f);
  EXPECT_LT(guided.opacity.masked_select(~mask).mean().item<float>(), 0.1f);
  const Tensor error = (guided.colour - ground_truth).abs().masked_select(mask.unsqueeze(2)).mean();
  EXPECT_LT(error.item<float>(), 0.15f);
  const FieldImage plain = actor.nerf->draw(projection, size, size);
  EXPECT_EQ(plain.colour.sizes(), guided.colour.sizes());
}

TEST_F(HybridTraining, OnlyWhatAPhaseTrainsMoves) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run", std::nullopt, "radiance");
  const Dataset dataset = Dataset::open(prepared_);
  HybridStage stage(dataset, actor, HybridRunConfig::read(chain().stage("radiance")));
  const auto gradients = [&](std::int64_t step) {
    for (Tensor& parameter : stage.model().parameters()) parameter.mutable_grad().reset();
    Profile profile;
    StepContext context{step, at::detail::createCPUGenerator(1), &profile};
    Tensor total;
    for (const LossTerm& term : static_cast<Stage&>(stage).loss(context))
      if (term.weight > 0.0) total = total.defined() ? total + term.weight * term.value : term.weight * term.value;
    total.backward();
    std::set<std::string> moved;
    for (const auto& parameter : stage.model().named_parameters())
      if (parameter.value().grad().defined()) moved.insert(parameter.key().substr(0, parameter.key().find('.')));
    return moved;
  };
  EXPECT_EQ(gradients(0), (std::set<std::string>{"field", "motion"}));
  EXPECT_EQ(gradients(100), (std::set<std::string>{"refined"}));
  EXPECT_EQ(gradients(147), (std::set<std::string>{"field", "motion", "refined"}));
}

TEST_F(HybridTraining, ResumedInAnyPhaseEqualsAnUnbrokenRunToTheBit) {
  const CheckpointFolder kept(*folder_ / "run/radiance/checkpoints");
  for (const std::int64_t stop : {54, 108}) {  // within a field phase, and within a refinement
    const fs::path resumed = *folder_ / ("resumed-" + std::to_string(stop));
    fs::copy(*folder_ / "run", resumed, fs::copy_options::recursive);
    fs::remove_all(resumed / "radiance/checkpoints");
    fs::create_directories(resumed / "radiance/checkpoints");
    fs::copy(kept.path(stop), resumed / "radiance/checkpoints");
    write_atomically(resumed / "radiance/checkpoints/latest", kept.path(stop).filename().string() + "\n");
    ChainOptions options;
    options.stages = {"radiance"};
    EXPECT_EQ(train_stages(chain(), resumed, options).at(0).summary.resumed_at, stop);
    support::expect_same_run(*folder_ / "run/radiance", resumed / "radiance");
  }
}

TEST_F(HybridTraining, ACheckpointHoldsTheMomentsOfWhatIsTrainedLater) {
  const CheckpointFolder kept(*folder_ / "run/radiance/checkpoints");
  const auto moments = [&](std::int64_t step) {
    std::set<std::string> of;
    const Checkpoint checkpoint = Checkpoint::load(kept.path(step));
    for (const auto& [name, tensor] : checkpoint.tensors())
      if (name.rfind("optimizer.first.", 0) == 0) of.insert(name.substr(16, name.find('.', 16) - 16));
    return of;
  };
  EXPECT_EQ(moments(54), (std::set<std::string>{"field", "motion"}));  // DeltaNet has had no gradient yet
  EXPECT_EQ(moments(108), (std::set<std::string>{"field", "motion", "refined"}));
  EXPECT_EQ(moments(150), std::set<std::string>{});
  const Checkpoint first = Checkpoint::load(kept.path(54)), last = Checkpoint::load(kept.path(150));
  std::uintmax_t deltanet = 0;
  for (const auto& [name, tensor] : first.tensors())
    if (name.rfind("model.around.", 0) == 0) {
      EXPECT_TRUE(torch::equal(tensor, first.tensor("model.refined." + name.substr(13)))) << name;
      deltanet += tensor.nbytes();
    }
  const auto size_without = [&](const Checkpoint& checkpoint) {
    std::uintmax_t size = 0;
    for (const auto& [name, tensor] : checkpoint.tensors())
      if (name.rfind("evaluation.", 0) != 0) size += tensor.nbytes();
    return size;
  };
  // Both DeltaNets are equal in the first phase, and stored once.
  EXPECT_LT(fs::file_size(kept.path(54)), size_without(first) - deltanet / 2);
  EXPECT_GT(fs::file_size(kept.path(150)), deltanet * 2);
}

TEST(HybridPlanReference, TheMomentsOfAPhaseThatDoesNotComeAgainAreNotNeeded) {
  const HybridPlan plan = plan_of("rounds: [{field: 10, refine: 4}, {field: 6, refine: 2}]\n");
  EXPECT_TRUE(plan.trains_field_from(0) && plan.trains_mesh_from(0));
  EXPECT_TRUE(plan.trains_field_from(10) && plan.trains_field_from(19));
  EXPECT_FALSE(plan.trains_field_from(20));
  EXPECT_TRUE(plan.trains_mesh_from(20) && plan.trains_mesh_from(21));
  EXPECT_FALSE(plan.trains_mesh_from(22));
  EXPECT_TRUE(plan_of("rounds: [{field: 10, refine: 4}]\njoint: 1\n").trains_field_from(14));
}

TEST_F(HybridTraining, ViewsWithoutThePersonCostNothing) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run", std::nullopt, "radiance");
  const Dataset dataset = Dataset::open(prepared_);
  HybridStage stage(dataset, actor, HybridRunConfig::read(chain().stage("radiance")));
  BatchOptions options;
  options.past_frames = actor.past_frames();
  options.images = true;
  Batch batch = make_batch(dataset, {dataset.samples(Split::train)[0]}, {{0, 1}}, options);
  batch.valid = torch::zeros_like(batch.valid);
  Profile profile;
  for (const std::int64_t step : {0, 100, 147}) {
    StepContext context{step, at::detail::createCPUGenerator(1), &profile};
    for (const LossTerm& term : stage.loss(batch, context)) EXPECT_EQ(term.value.item<double>(), 0.0) << term.name;
  }
}

TEST_F(HybridTraining, ARunOfDdcLendsItsStages) {
  const std::string text = "capture: " + prepared_.string() + "\nstage: hybrid\nddc: " + (*folder_ / "run").string() +
                           "\nradiance:\n  data: {frames: [3]}\n  model: {motion: {features: 4, residual_blocks: 2}, "
                           "field: {features: 4, layers: 1, width: 8}}\n  rays: {count: 20, samples: 4}\n"
                           "  rounds: [{field: 3, refine: 2}]\n";
  const auto summaries = train_stages(StageChain::read(ConfigDocument::parse(text, "c.yaml")), *folder_ / "lent", {});
  ASSERT_EQ(summaries.size(), 1u);
  EXPECT_EQ(summaries[0].summary.step, 5);
  EXPECT_EQ(TrainedActor::load(*folder_ / "lent").steps.at("deltanet"), 4);
}

TEST_F(HybridTraining, MistakesAreNamed) {
  EXPECT_THAT(message_of([] { chain({"radiance.data.batch_size=2"}); }), HasSubstr("only 1 is allowed"));
  EXPECT_THAT(message_of([] { chain({"radiance.rays.stencil=4"}); }), HasSubstr("odd"));
  EXPECT_THAT(message_of([] { chain({"radiance.train.iterations=4"}); }), HasSubstr("rounds"));
  EXPECT_THAT(message_of([] { chain({"radiance.rond=4"}); }), HasSubstr("radiance.rond"));
  EXPECT_THAT(message_of([] { chain({"radiance.joint=0", "radiance.rates.joint=1e-3"}); }), HasSubstr("rates.joint"));
  EXPECT_THAT(message_of([] { chain({"nerf.data.batch_size=2"}); }), HasSubstr("only 1 is allowed"));
  EXPECT_THAT(message_of([] { chain({"nerf.model.field.skip=2"}); }), HasSubstr("less than `layers`, 2"));
  TrainedActor actor = TrainedActor::load(*folder_ / "run", std::nullopt, "radiance");
  const Dataset dataset = Dataset::open(prepared_);
  const HybridRunConfig late = HybridRunConfig::read(chain({"radiance.data.frames=[99]"}).stage("radiance"));
  EXPECT_THAT(message_of([&] { HybridStage(dataset, actor, late); }),
              AllOf(HasSubstr("frame 99"), HasSubstr("0 to 11")));
  const std::string bare = "capture: " + prepared_.string() +
                           "\nstage: hybrid\negnet: {run: " + (*folder_ / "run").string() + "}\nradiance: {}\n";
  EXPECT_THAT(
      message_of([&] { train_stages(StageChain::read(ConfigDocument::parse(bare, "c.yaml")), *folder_ / "bare", {}); }),
      HasSubstr("deltanet={run: RUN}"));
}

TEST_F(HybridTraining, AFieldWithoutAMeshIsOfOneFrame) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run", std::nullopt, "radiance");
  const Dataset dataset = Dataset::open(prepared_);
  const NerfRunConfig config = NerfRunConfig::read(chain({"nerf.data.frames=[1,2]"}).stage("nerf"));
  EXPECT_THAT(message_of([&] { NerfStage(dataset, actor, config); }),
              AllOf(HasSubstr("found 2"), HasSubstr("nerf.data.frames=[1]")));
}

TEST_F(HybridTraining, AnOpenTemplateIsRefusedWithItsEdges) {
  TrainedActor actor = TrainedActor::load(*folder_ / "run", std::nullopt, "radiance");
  actor.character.mesh.faces.pop_back();
  const Dataset dataset = Dataset::open(prepared_);
  EXPECT_THAT(message_of([&] { HybridStage(dataset, actor, HybridRunConfig::read(chain().stage("radiance"))); }),
              HasSubstr("edge"));
}

}  // namespace
}  // namespace doppel::hybrid_stage_test
