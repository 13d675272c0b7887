#include "doppel/nets/delta_net.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/csrc/jit/runtime/graph_executor.h>
#include <torch/optim/adam.h>
#include <torch/serialize.h>
#include <torch/types.h>

#include <cmath>
#include <optional>
#include <sstream>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "support/gradient_check.h"
#include "support/test_character.h"

namespace doppel::delta_net_test {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

DeltaNetConfig small_config(NetworkKind kind = NetworkKind::sagcn) {
  DeltaNetConfig config;
  config.sagcn.features = 8;
  config.sagcn.residual_blocks = 2;
  config.network = kind;
  config.ablation.fully_connected_layers = 4;
  config.ablation.fully_connected_width = 32;
  return config;
}

Tensor random_windows(const Character& character, int64_t batch, int64_t frames = 3) {
  auto generator = at::detail::createCPUGenerator(21);
  const Tensor rest = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat64);
  return (rest + 0.3 * torch::randn({batch, frames, character.num_dofs()}, generator, torch::kFloat64))
      .to(torch::kFloat32);
}

/// The same motion of a person who stands and faces elsewhere.
Tensor turned_and_moved(const Character& character, const Tensor& window, double turn) {
  const auto root = character.skeleton.root();
  const double c = std::cos(turn), s = std::sin(turn);
  Tensor moved = window.clone();
  const Tensor x = window.select(2, root.translation[0]), z = window.select(2, root.translation[2]);
  moved.select(2, root.translation[0]).copy_(c * x + s * z + 1.5);
  moved.select(2, root.translation[1]).add_(0.4);
  moved.select(2, root.translation[2]).copy_(-s * x + c * z - 2.0);
  moved.select(2, root.rotation[0]).add_(turn / root.rotation_weight[0]);
  return moved;
}

double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

/// Standardised as a training run would.
DeltaNet standardised(const Character& character, const DeltaNetConfig& config) {
  DeltaNet net(character, config);
  const Tensor input = net->network_input(random_windows(character, 8));
  net->set_input_statistics(input.mean(0), input.std(0));
  return net;
}

const std::vector<NetworkKind> kKinds{NetworkKind::sagcn, NetworkKind::fully_connected, NetworkKind::chebyshev};

TEST(DeltaNetReference, InputIsTheTemplatePosedByTheNormalisedWindow) {
  const Character character = make_test_character();
  DeltaNet net(character, small_config());
  const Tensor window = random_windows(character, 2).to(torch::kFloat64);
  const Tensor input = net->network_input(window);
  ASSERT_EQ(input.sizes(), (std::vector<int64_t>{2, character.num_vertices(), 9}));
  CharacterSurface surface(character);
  const Tensor normalised = MotionWindow(character.skeleton).normalise_dofs(window);
  // Editing DoFs leaves the joints before the root's rotation where they are, so the heading turns about the root only
  // where the root stands: compare with the same posing of edited DoFs.
  for (int frame = 0; frame < 3; ++frame)
    EXPECT_TRUE(test::is_near(input.narrow(2, 3 * frame, 3), surface->skinned(normalised.select(1, frame)), 1e-9));
}

TEST(DeltaNetReference, StartsAtTheDeformedSurface) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNet net(character, small_config(kind));
    for (const int64_t batch : {1, 4}) {
      const Tensor D = net->forward(random_windows(character, batch));
      EXPECT_EQ(D.sizes(), (std::vector<int64_t>{batch, character.num_vertices(), 3}));
      EXPECT_LT(largest(D), 0.02);
      EXPECT_GT(largest(D), 0.0);
    }
  }
}

TEST(DeltaNetReference, OutputIgnoresWhereOnePersonStandsAndFaces) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNetConfig config = small_config(kind);
    config.sagcn.head_scale = 0.3;
    DeltaNet net(character, config);
    const Tensor window = random_windows(character, 3);
    const Tensor D = net->forward(window);
    ASSERT_GT(largest(D), 1e-2);
    for (const double turn : {0.7, -2.5, 6.0})
      EXPECT_LT(largest(D - net->forward(turned_and_moved(character, window, turn))), 2e-4 * (1.0 + largest(D)))
          << "turned by " << turn;
  }
}

/// The window of the texture (M tilde of 6.4), which the radiance field takes (6.25): moved people look the same,
/// turned people do not.
TEST(DeltaNetReference, KeptHeadingIsSeenAndThePositionIsNot) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNetConfig config = small_config(kind);
    config.sagcn.head_scale = 0.3;
    config.heading = Heading::kept;
    DeltaNet net(character, config);
    const Tensor window = random_windows(character, 3);
    const Tensor D = net->forward(window);
    EXPECT_LT(largest(D - net->forward(turned_and_moved(character, window, 0.0))), 2e-4 * (1.0 + largest(D)));
    EXPECT_GT(largest(D - net->forward(turned_and_moved(character, window, 1.3))), 1e-2 * largest(D));
  }
}

TEST(DeltaNetReference, KeptHeadingPosesTheTemplateByTheMovedWindow) {
  const Character character = make_test_character();
  DeltaNetConfig config = small_config();
  config.heading = Heading::kept;
  DeltaNet net(character, config);
  const Tensor window = random_windows(character, 2).to(torch::kFloat64);
  const Tensor input = net->network_input(window);
  CharacterSurface surface(character);
  const Tensor moved = MotionWindow(character.skeleton).remove_translation(window);
  for (int frame = 0; frame < 3; ++frame)
    EXPECT_TRUE(test::is_near(input.narrow(2, 3 * frame, 3), surface->skinned(moved.select(1, frame)), 1e-9));
}

TEST(DeltaNetReference, GlobalDisplacementsTurnWithTheBody) {
  const Character character = make_test_character();
  DeltaNetConfig config = small_config();
  config.space = DisplacementSpace::global;
  DeltaNet net(character, config);
  CharacterSurface surface(character);
  const Tensor window = random_windows(character, 2), none = torch::zeros({2, character.num_nodes(), 3});
  const Tensor D = 0.05 * torch::randn({2, character.num_vertices(), 3}, at::detail::createCPUGenerator(3));
  const Tensor bare = surface->skinned_by_nodes(window.select(1, 2).contiguous());
  const Tensor moved = net->displaced(surface, window, none, none, D) - bare;
  EXPECT_TRUE(test::is_near(moved.norm(2, -1), D.norm(2, -1), 1e-5)) << "a rotation keeps lengths";
  EXPECT_TRUE(test::is_near(moved.select(-1, 1), D.select(-1, 1), 1e-5)) << "about y";

  const double turn = 0.8;
  const Tensor turned = turned_and_moved(character, window, turn);
  const Tensor turned_moved =
      net->displaced(surface, turned, none, none, D) - surface->skinned_by_nodes(turned.select(1, 2).contiguous());
  const Tensor x = moved.select(-1, 0), z = moved.select(-1, 2);
  EXPECT_TRUE(test::is_near(turned_moved.select(-1, 0), std::cos(turn) * x + std::sin(turn) * z, 1e-5));
  EXPECT_TRUE(test::is_near(turned_moved.select(-1, 2), -std::sin(turn) * x + std::cos(turn) * z, 1e-5));
}

TEST(DeltaNetReference, CanonicalDisplacementsArePosed) {
  const Character character = make_test_character();
  DeltaNet net(character, small_config());
  CharacterSurface surface(character);
  const Tensor window = random_windows(character, 2), none = torch::zeros({2, character.num_nodes(), 3});
  const Tensor D = 0.05 * torch::randn({2, character.num_vertices(), 3}, at::detail::createCPUGenerator(3));
  EXPECT_TRUE(torch::equal(net->displaced(surface, window, none, none, D),
                           surface->deformed(window.select(1, 2).contiguous(), none, none, D)));
}

TEST(DeltaNetReference, StandardisesItsInput) {
  const Character character = make_test_character();
  DeltaNet net(character, small_config());
  const Tensor window = random_windows(character, 6);
  const Tensor before = net->forward(window);
  net->set_input_statistics(torch::zeros({9}), torch::ones({9}));
  EXPECT_TRUE(torch::equal(before, net->forward(window)));
  const Tensor input = net->network_input(window);
  net->set_input_statistics(input.mean(0), input.std(0));
  EXPECT_FALSE(torch::equal(before, net->forward(window)));
  EXPECT_THROW(net->set_input_statistics(torch::zeros({5}), torch::ones({5})), UsageError);
  EXPECT_THROW(net->set_input_statistics(torch::full({9}, NAN), torch::ones({9})), Error);
}

TEST(DeltaNetAgrees, WithItsReferencePathInValueAndGradient) {
  const Character character = make_test_character();
  const Tensor window = random_windows(character, 3);
  for (const DenseBlock dense : {DenseBlock::broadcast, DenseBlock::matrix, DenseBlock::none}) {
    DeltaNetConfig config = small_config();
    config.sagcn.dense = dense;
    config.sagcn.head_scale = 0.3;
    DeltaNet net = standardised(character, config);
    const auto run = [&] {
      net->zero_grad();
      const Tensor D = net->forward(window);
      D.square().sum().backward();
      std::vector<Tensor> results{D.detach()};
      for (const Tensor& parameter : net->parameters()) results.push_back(parameter.grad().clone());
      return results;
    };
    const auto fast = run();
    const ReferenceScope reference;
    const auto plain = run();
    for (std::size_t i = 0; i < fast.size(); ++i)
      EXPECT_LT(largest(fast[i] - plain[i]), 1e-3 * (1.0 + largest(plain[i]))) << i;
  }
}

TEST(DeltaNetAgrees, BitForBitAtAnyNumberOfThreads) {
  const Character character = make_test_character(5, 16, 60);
  const Tensor window = random_windows(character, 1);
  std::vector<Tensor> results;
  const int before = at::get_num_threads();
  for (const int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    DeltaNet net(character, small_config());
    results.push_back(net->forward(window).detach());
  }
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(results[0], results[1]));
  EXPECT_TRUE(torch::equal(results[0], results[2]));
}

TEST(DeltaNetAgrees, OnAnEmptyBatch) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNet net(character, small_config(kind));
    EXPECT_EQ(net->forward(torch::zeros({0, 3, character.num_dofs()})).sizes(),
              (std::vector<int64_t>{0, character.num_vertices(), 3}));
  }
}

TEST(DeltaNetAgrees, AsATraceOnBatchesItHasNotSeen) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds)
    for (const DisplacementSpace space : {DisplacementSpace::canonical, DisplacementSpace::global}) {
      DeltaNetConfig config = small_config(kind);
      config.sagcn.head_scale = 0.3;
      config.space = space;
      DeltaNet net = standardised(character, config);
      CharacterSurface surface(character);
      net->eval();
      for (Tensor parameter : net->parameters()) parameter.set_requires_grad(false);  // here they become constants
      const auto vertices = [&](const Tensor& window) {
        const Tensor none = torch::zeros({character.num_nodes(), 3}).expand({window.size(0), -1, -1});
        return net->displaced(surface, window, none, none, net->forward(window));
      };
      const auto traced = torch::jit::tracer::trace(
          {random_windows(character, 2)},
          [&](torch::jit::Stack stack) -> torch::jit::Stack { return {net->forward(stack[0].toTensor())}; },
          [](const torch::autograd::Variable&) { return ""; });
      for (const torch::jit::Node* node : traced.first->graph->nodes())
        EXPECT_NE(std::string(node->kind().ns().toUnqualString()), "doppel") << "an op of our own in the trace";
      torch::jit::GraphExecutor executor(traced.first->graph, "deltanet");
      for (const int64_t batch : {1, 5}) {
        const Tensor window = turned_and_moved(character, random_windows(character, batch), 1.1);
        torch::jit::Stack stack{window};
        executor.run(stack);
        const Tensor D = net->forward(window);
        EXPECT_LT(largest(stack[0].toTensor() - D), 1e-4 * (1.0 + largest(D))) << "batch " << batch;
        EXPECT_EQ(vertices(window).size(0), batch);
      }
    }
}

TEST(DeltaNetGradient, OfItsInputMatchesCentralDifferences) {
  const Character character = make_test_character(3, 4, 4);
  for (const NetworkKind kind : kKinds) {
    DeltaNetConfig config = small_config(kind);
    config.sagcn.features = 2;
    config.sagcn.head_scale = 0.5;
    config.ablation.fully_connected_width = 5;
    DeltaNet net(character, config);
    net->to(torch::kFloat64);
    test::GradientOptions options;
    options.relative = 1e-5;
    options.absolute = 1e-6;
    EXPECT_TRUE(test::gradients_match([&](const std::vector<Tensor>& x) { return net->forward(x[0]); },
                                      {{"dof_window", random_windows(character, 2).to(torch::kFloat64)}}, options));
  }
}

TEST(DeltaNetRecovers, WrinklesThatFollowTheMotion) {
  const Character character = make_test_character();
  const Tensor windows = random_windows(character, 8);
  for (const NetworkKind kind : kKinds) {
    DeltaNet net = standardised(character, small_config(kind));
    const Tensor input = DeltaNet(character, small_config())->network_input(windows);
    const Tensor target = 0.05 * (input.narrow(2, 6, 3) - input.narrow(2, 3, 3));  // trails behind
    torch::optim::Adam adam(net->parameters(), torch::optim::AdamOptions(2e-3));
    double first = 0.0, last = 0.0;
    for (int step = 0; step < 200; ++step) {
      adam.zero_grad();
      const Tensor loss = (net->forward(windows) - target).square().mean();
      loss.backward();
      adam.step();
      last = loss.item<double>();
      if (step == 0) first = last;
    }
    // Weights shared by all vertices cannot tell them apart; the other two learn by heart.
    EXPECT_LT(last, (kind == NetworkKind::chebyshev ? 0.5 : 0.05) * first) << static_cast<int>(kind);
  }
}

TEST(DeltaNetRecovers, ItsStateFromAnArchive) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNet net = standardised(character, small_config(kind));
    const Tensor windows = random_windows(character, 4), expected = net->forward(windows);
    std::stringstream file;
    torch::serialize::OutputArchive out;
    net->save(out);
    out.save_to(file);
    DeltaNet other(character, small_config(kind), at::detail::createCPUGenerator(99));
    EXPECT_FALSE(torch::equal(expected, other->forward(windows)));
    torch::serialize::InputArchive in;
    in.load_from(file);
    other->load(in);
    EXPECT_TRUE(torch::equal(expected, other->forward(windows)));
  }
}

DeltaNetConfig read(const std::string& text) {
  const ConfigDocument document = ConfigDocument::parse(text, "deltanet.yaml");
  const ConfigReader root = document.root();
  const DeltaNetConfig config = read_options<DeltaNetConfig>(root);
  root.finish();
  return config;
}

TEST(DeltaNetConfigReference, ReadsDefaultsAndChanges) {
  const DeltaNetConfig paper = read("{}");
  EXPECT_EQ(paper.sagcn.rings, 3);
  EXPECT_EQ(paper.sagcn.features, 16);
  EXPECT_EQ(paper.sagcn.residual_blocks, 8);
  EXPECT_EQ(paper.sagcn.norm, SagcnNorm::none);
  EXPECT_EQ(paper.sagcn.dense, DenseBlock::broadcast);
  EXPECT_EQ(paper.space, DisplacementSpace::canonical);
  EXPECT_EQ(paper.ablation.fully_connected_layers, 19);
  const DeltaNetConfig changed = read(
      "space: global\nnetwork: chebyshev\nchebyshev_order: 4\nnorm: channel\ndense: none\npast_frames: 1\nfeatures: "
      "8");
  EXPECT_EQ(changed.space, DisplacementSpace::global);
  EXPECT_EQ(changed.network, NetworkKind::chebyshev);
  EXPECT_EQ(changed.ablation.chebyshev_order, 4);
  EXPECT_EQ(changed.sagcn.dense, DenseBlock::none);
  EXPECT_EQ(changed.past_frames, 1);
}

TEST(DeltaNetConfigRejects, MistakesWithFileAndKey) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_THAT(message("space: world"), HasSubstr("space"));
  EXPECT_THAT(message("network: mlp"), HasSubstr("network"));
  EXPECT_THAT(message("chebyshev_order: 0"), HasSubstr("chebyshev_order"));
  EXPECT_THAT(message("past_frames: -1"), HasSubstr("past_frames"));
  EXPECT_THAT(message("spce: global"), HasSubstr("space"));
  EXPECT_THAT(message("residual_blocks: 3"), HasSubstr("even"));
}

TEST(DeltaNetRejects, AWindowOfAnotherLength) {
  const Character character = make_test_character();
  for (const NetworkKind kind : kKinds) {
    DeltaNet net(character, small_config(kind));
    try {
      net->forward(random_windows(character, 2, 4));
      FAIL() << "nothing was thrown";
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("dof_window"));
    }
  }
  DeltaNetConfig config = small_config();
  config.past_frames = -1;
  EXPECT_THROW(DeltaNet(character, config), UsageError);
}

}  // namespace
}  // namespace doppel::delta_net_test
