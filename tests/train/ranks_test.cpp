#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/actor/trained_actor.h"
#include "doppel/nets/shared_norm.h"
#include "doppel/train/egnet_stage.h"
#include "doppel/train/stage_chain.h"
#include "support/rank_threads.h"
#include "support/small_capture.h"
#include "support/small_pose_run.h"
#include "support/temporary_folder.h"

/// n ranks = one rank with the whole batch, for each stage. The ranks are threads on the loopback interface.
namespace doppel::train_ranks_test {
namespace {

using support::on_ranks;
using support::TemporaryFolder;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
namespace fs = std::filesystem;

/// @param read reads the configuration; each rank reads its own, because a document notes which keys were read
void train(const std::function<StageChain()>& read, const fs::path& out, int world) {
  const auto errors = on_ranks(world, [&](Ranks& ranks) {
    ChainOptions options;
    options.ranks = &ranks;
    train_stages(read(), out, options);
  });
  EXPECT_THAT(errors, Each(IsEmpty()));
}

/// The loss and every term of every step to 1e-5 of the loss, or of 1 where the loss is smaller.
void expect_same_losses(const fs::path& one, const fs::path& several) {
  const auto expected = read_metrics(RunFolder(one).metrics()), found = read_metrics(RunFolder(several).metrics());
  ASSERT_GT(expected.size(), 3u);
  ASSERT_EQ(expected.size(), found.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    SCOPED_TRACE("step " + std::to_string(expected[i].step));
    const double tolerance = 1e-5 * std::max(1.0, std::abs(expected[i].loss));
    EXPECT_NEAR(expected[i].loss, found[i].loss, tolerance);
    ASSERT_EQ(expected[i].terms.size(), found[i].terms.size());
    for (std::size_t t = 0; t < expected[i].terms.size(); ++t)
      EXPECT_NEAR(expected[i].terms[t].weighted, found[i].terms[t].weighted, tolerance) << expected[i].terms[t].name;
  }
}

// Small rates: training amplifies differences of rounding, at large rates to 1e-5 within a few steps.
constexpr char kStages[] = R"(stage: hybrid
egnet:
  data: {batch_size: 5, cameras_per_sample: 2, pose_noise: 0.05, input_noise: 0.02}
  model: {features: 4, residual_blocks: 2, rings: 2, dense: broadcast}
  train: {iterations: 20, learning_rate: 1e-4, log_every: 1}
lighting:
  data: {batch_size: 3, image_size: 48}
  loss: {deviation: 100}
  train: {iterations: 20, learning_rate: 0.03, log_every: 1}
deltanet:
  data: {batch_size: 4, cameras_per_sample: 2, image_size: 48, pose_noise: 0.01}
  model: {features: 4, residual_blocks: 2, rings: 2}
  train: {iterations: 12, learning_rate: 5e-5, log_every: 1}
texnet:
  data: {batch_size: 3, image_size: 48, pose_noise: 0.01}
  model: {size: 128, levels: 4, width: 0.1, dropout: 0.5, camera_centre: root_relative, residual: true}
  loss: {distance: squares}
  train: {iterations: 12, learning_rate: 2e-4, log_every: 1}
gaussians:
  data: {batch_size: 3, image_size: 48}
  model: {size: 64, levels: 4, width: 0.1, lit: true}
  train: {iterations: 12, learning_rate: 1e-4, log_every: 1}
radiance:
  data: {cameras_per_sample: 2}
  model:
    motion: {features: 4, residual_blocks: 2, rings: 2}
    field: {features: 8, layers: 2, width: 32, view_width: 16}
  rays: {count: 255, samples: 16, stencil: 5, cloud: 600}
  loss: {silhouette: 1, laplacian: 1e5}
  rounds:
    - {field: 12, refine: 4, variance: 0.01}
  joint: 3
  rates: {field: 1e-3, refine: 1e-4}
  train: {log_every: 1}
nerf:
  data: {cameras_per_sample: 3, frames: [4]}
  model: {coarse: 8, fine: 8, position_octaves: 4, field: {layers: 2, width: 32, view_width: 16}}
  rays: {count: 128}
  train: {iterations: 15, learning_rate: 1e-3, log_every: 1}
)";

/// Stages on one capture. The run `one` is trained by one rank.
class RanksOfActors : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    SmallCaptureOptions options;
    options.textured = true;
    prepared_ = make_small_capture(*folder_ / "capture", options);
    train([] { return chain(); }, *folder_ / "one", 1);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static StageChain chain(const std::vector<std::string>& overrides = {}) {
    return StageChain::read(
        ConfigDocument::parse("capture: " + prepared_.string() + "\n" + kStages, "chain.yaml", overrides));
  }
  /// Trains a stage with several ranks on the other stages of the run `one`.
  static void expect_like_one(const std::string& stage, int world) {
    SCOPED_TRACE(stage + " with " + std::to_string(world) + " ranks");
    std::vector<std::string> overrides;
    for (const std::string name : {"egnet", "lighting", "deltanet", "texnet", "gaussians", "radiance", "nerf"})
      if (name != stage) overrides.push_back(name + "={run: " + (*folder_ / "one").string() + "}");
    const fs::path out = *folder_ / (stage + std::to_string(world));
    train([&] { return chain(overrides); }, out, world);
    expect_same_losses(*folder_ / "one" / stage, out / stage);
  }
  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static fs::path prepared_;
};

TEST_F(RanksOfActors, EgNet) {
  expect_like_one("egnet", 2);
  expect_like_one("egnet", 3);
}
TEST_F(RanksOfActors, Lighting) { expect_like_one("lighting", 2); }
TEST_F(RanksOfActors, DeltaNet) { expect_like_one("deltanet", 2); }
TEST_F(RanksOfActors, TexNet) { expect_like_one("texnet", 2); }
TEST_F(RanksOfActors, Gaussians) { expect_like_one("gaussians", 2); }
TEST_F(RanksOfActors, Hybrid) { expect_like_one("radiance", 2); }
TEST_F(RanksOfActors, Nerf) { expect_like_one("nerf", 2); }

TEST_F(RanksOfActors, RunThatGoesOnWithOtherRanksIsTheSame) {
  const EgNetRunConfig config = EgNetRunConfig::read(chain().stage("egnet"));
  const RunFolder run(*folder_ / "changing");
  run.open("stage: egnet\n", RunMode::automatic);
  std::int64_t stop = 0;
  for (const int world : {2, 1, 3}) {
    stop += world == 3 ? 6 : 7;
    const auto errors = on_ranks(world, [&](Ranks& ranks) {
      const Dataset dataset = Dataset::open(config.subject.capture);
      const Character character = load_character(dataset.character_path(), config.subject.character);
      EgNetStage stage(dataset, character, config);
      TrainerOptions options = config.trainer;
      options.iterations = stop;
      const TrainSummary summary = Trainer(stage, options, run, &ranks).run();
      EXPECT_EQ(summary.step, stop);
    });
    EXPECT_THAT(errors, Each(IsEmpty()));
  }
  expect_same_losses(*folder_ / "one" / "egnet", run.path());
}

TEST_F(RanksOfActors, MoreRanksThanSamplesAreRefused) {
  const auto errors = on_ranks(4, [&](Ranks& ranks) {
    ChainOptions options;
    options.ranks = &ranks;
    train_stages(chain({"lighting={run: " + (*folder_ / "one").string() + "}", "egnet.data.batch_size=3"}),
                 *folder_ / "crowd", options);
  });
  for (const std::string& error : errors) EXPECT_THAT(error, HasSubstr("a batch of 3 cannot be shared by 4 ranks"));
}

class RanksOfPoses : public support::SmallPoseRun {};

TEST_F(RanksOfPoses, PoseNetAndDefNet) {
  const std::vector<std::string> each{
      "posenet.phases=[{iterations: 5, learning_rate: 1e-6, limits: 1}, {iterations: 2, learning_rate: 1e-7}]",
      "posenet.train.log_every=1", "defnet.train.log_every=1", "defnet.train.learning_rate=1e-7",
      "defnet.data.batch_size=3"};
  train([&] { return chain(each); }, *folder_ / "one", 1);
  train([&] { return chain(each); }, *folder_ / "two", 2);
  expect_same_losses(*folder_ / "one/posenet", *folder_ / "two/posenet");
  std::vector<std::string> lent = each;
  lent.push_back("posenet={run: " + (*folder_ / "one").string() + "}");
  train([&] { return chain(lent); }, *folder_ / "lent", 2);
  expect_same_losses(*folder_ / "one/defnet", *folder_ / "lent/defnet");
}

// ---- batch normalisation ----

TEST(SharedBatchNormReference, EqualsThatOfTheWholeBatch) {
  using Sizes = std::vector<std::int64_t>;
  for (const auto& [shape, rows] : {std::pair<Sizes, Sizes>{{7, 5}, {0}}, {{7, 5}, {1}}, {{5, 3, 4, 6}, {0, 2, 3}}}) {
    const auto generator = at::detail::createCPUGenerator(3);
    const auto normal = [&](std::vector<std::int64_t> sizes) {
      return torch::empty(sizes).normal_(2.0, 3.0, generator);
    };
    const std::int64_t C = shape[1];
    const torch::Tensor all = normal(shape), upstream = normal(shape);
    const torch::Tensor weight = normal({C}), bias = normal({C});
    const torch::Tensor x = all.clone().requires_grad_(), w = weight.clone().requires_grad_(),
                        b = bias.clone().requires_grad_();
    const torch::Tensor mean = torch::zeros({C}), var = torch::ones({C});
    const torch::Tensor y = at::batch_norm(x, w, b, mean, var, true, 0.1, 1e-3, false);
    (y * upstream).sum().backward();
    torch::Tensor sum_w = torch::zeros({C}), sum_b = torch::zeros({C});
    std::mutex mutex;
    const auto errors = on_ranks(3, [&](Ranks& ranks) {
      const BatchShare share = ranks.share(shape[0]);
      const torch::Tensor mine = share.rows(all).clone().requires_grad_(), own_w = weight.clone().requires_grad_(),
                          own_b = bias.clone().requires_grad_();
      const torch::Tensor own_mean = torch::zeros({C}), own_var = torch::ones({C});
      const SharedStatistics shared = share_statistics(rows.front() == 1 ? mine.t() : mine, rows, own_w, own_b,
                                                       own_mean, own_var, 0.1, 1e-3, ranks);
      const torch::Tensor out =
          at::batch_norm(mine, shared.weight, shared.bias, shared.mean, shared.variance, false, 0.0, 1e-3, false);
      (out * share.rows(upstream)).sum().backward();
      EXPECT_TRUE(torch::allclose(out, share.rows(y), 1e-5, 1e-5));
      EXPECT_TRUE(torch::allclose(mine.grad(), share.rows(x.grad()), 1e-4, 1e-5));
      EXPECT_TRUE(torch::allclose(own_mean, mean, 1e-6, 1e-6));
      EXPECT_TRUE(torch::allclose(own_var, var, 1e-5, 1e-6));
      const std::lock_guard lock(mutex);
      sum_w += own_w.grad();
      sum_b += own_b.grad();
    });
    EXPECT_THAT(errors, Each(IsEmpty()));
    EXPECT_TRUE(torch::allclose(sum_w, w.grad(), 1e-4, 1e-4));
    EXPECT_TRUE(torch::allclose(sum_b, b.grad(), 1e-4, 1e-4));
  }
}

// ---- gradients ----

TEST(GradientSumReference, SmallBucketsAndMissingGradientsGiveTheSum) {
  struct Three : torch::nn::Module {
    Three() {
      for (const char* name : {"a", "b", "c"}) register_parameter(name, torch::ones({10}));
    }
  };
  const auto errors = on_ranks(2, [](Ranks& ranks) {
    const auto model = std::make_shared<Three>();
    auto p = model->named_parameters();
    GradientSum gradients(*model, &ranks, 40);
    for (int step = 0; step < 3; ++step) {
      for (auto& item : p) item.value().mutable_grad().reset();
      // `a` on both ranks, `b` on rank 1 only, `c` on none
      torch::Tensor loss = (p["a"] * (ranks.rank() + 1.0)).sum();
      if (ranks.rank() == 1) loss = loss + (p["b"] * 5.0).sum();
      loss.backward();
      gradients.finish();
      EXPECT_TRUE(p["a"].grad().eq(3.0).all().item<bool>());
      EXPECT_TRUE(p["b"].grad().defined() && p["b"].grad().eq(5.0).all().item<bool>());
      EXPECT_FALSE(p["c"].grad().defined());
    }
  });
  EXPECT_THAT(errors, Each(IsEmpty()));
}

}  // namespace
}  // namespace doppel::train_ranks_test
