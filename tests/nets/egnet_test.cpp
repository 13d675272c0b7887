#include "doppel/nets/egnet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/csrc/jit/runtime/graph_executor.h>
#include <torch/optim/adam.h>
#include <torch/serialize.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <optional>
#include <sstream>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::egnet_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

EgNetConfig small_config() {
  EgNetConfig config = EgNetConfig::preset("paper");
  config.sagcn.features = 8;
  config.sagcn.residual_blocks = 2;
  return config;
}

/// Windows near the rest pose, anywhere in the room.
Tensor random_windows(const Character& character, int64_t batch, int64_t frames = 3) {
  torch::manual_seed(21);
  const Tensor rest = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat64);
  return (rest + 0.3 * torch::randn({batch, frames, character.num_dofs()}, torch::kFloat64)).to(torch::kFloat32);
}

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

TEST(EgNetReference, SeesNothingInTheRestPose) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  // Standing still in the rest pose, turned and moved: no node leaves its position but for the heading and root of the
  // rest pose.
  Tensor dofs = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat64);
  const auto root = character.skeleton.root();
  for (int i = 0; i < 3; ++i) dofs[root.translation[i]] = 0.0;
  dofs[root.rotation[0]] = 0.0;
  Character upright = character;
  for (int d = 0; d < character.num_dofs(); ++d) upright.rest_dofs[d] = dofs[d].item<double>();
  EgNet upright_net(upright, small_config());
  const Tensor window = dofs.to(torch::kFloat32).expand({2, 3, -1});
  const Tensor features = upright_net->node_features(turned_and_moved(character, window, 0.9));
  EXPECT_EQ(features.sizes(), (std::vector<int64_t>{2, character.num_nodes(), 18}));
  EXPECT_LT(largest(features), 1e-5);
}

TEST(EgNetReference, FeaturesAreTranslationAndEulerAnglesFrameAfterFrame) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  config.node_features = NodeFeatures::transform;
  EgNet net(character, config);
  const Tensor window = random_windows(character, 2);
  const Tensor features = net->node_features(window);
  config.rotation = RotationFeatures::rotation_6d;
  const Tensor wide = EgNet(character, config)->node_features(window);
  ASSERT_EQ(wide.size(2), 27);
  for (int frame = 0; frame < 3; ++frame) {
    EXPECT_LT(largest(features.narrow(2, 6 * frame, 3) - wide.narrow(2, 9 * frame, 3)), 1e-6);
    const Tensor matrix = euler_to_matrix(features.narrow(2, 6 * frame + 3, 3));
    EXPECT_LT(largest(matrix.select(-1, 0) - wide.narrow(2, 9 * frame + 3, 3)), 1e-5);
    EXPECT_LT(largest(matrix.select(-1, 1) - wide.narrow(2, 9 * frame + 6, 3)), 1e-5);
  }
}

TEST(EgNetReference, OutputIgnoresWhereOnePersonStandsAndFaces) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  config.sagcn.head_scale = 0.3;
  EgNet net(character, config);
  net->eval();
  const Tensor window = random_windows(character, 3);
  for (const bool reference : {false, true}) {
    std::optional<ReferenceScope> plain;
    if (reference) plain.emplace();
    const auto [A, T] = net->forward(window);
    ASSERT_GT(largest(A), 1e-2);
    for (const double turn : {0.7, -2.5, 6.0}) {
      const auto [turned_A, turned_T] = net->forward(turned_and_moved(character, window, turn));
      EXPECT_LT(largest(A - turned_A), 1e-4) << "turned by " << turn;
      EXPECT_LT(largest(T - turned_T), 1e-4) << "turned by " << turn;
    }
  }
}

TEST(EgNetReference, StartsAtTheSkinnedTemplate) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  const auto [A, T] = net->forward(random_windows(character, 4));
  EXPECT_EQ(A.sizes(), (std::vector<int64_t>{4, character.num_nodes(), 3}));
  EXPECT_EQ(T.sizes(), A.sizes());
  EXPECT_LT(largest(A), 0.02);
  EXPECT_LT(largest(T), 0.02);
}

TEST(EgNetReference, StandardisesItsInput) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  net->eval();
  const Tensor window = random_windows(character, 6);
  const Tensor features = net->node_features(window);
  const auto before = net->forward(window);
  net->set_input_statistics(torch::zeros({18}), torch::ones({18}));
  EXPECT_TRUE(torch::equal(before.first, net->forward(window).first));
  net->set_input_statistics(features.mean(0), features.std(0));
  EXPECT_FALSE(torch::equal(before.first, net->forward(window).first));
  EXPECT_THROW(net->set_input_statistics(torch::zeros({5}), torch::ones({5})), UsageError);
  EXPECT_THROW(net->set_input_statistics(torch::full({18}, NAN), torch::ones({18})), Error);
}

TEST(EgNetAgrees, WithItsReferencePath) {
  const Character character = make_test_character();
  for (const char* preset : {"paper", "public_checkpoint"}) {
    EgNetConfig config = EgNetConfig::preset(preset);
    config.sagcn.head_scale = 0.3;
    config.rotation = RotationFeatures::rotation_6d;  // Euler angles may jump between the two
    EgNet net(character, config);
    net->eval();
    const Tensor window = random_windows(character, 3);
    const auto fast = net->forward(window);
    const ReferenceScope reference;
    const auto plain = net->forward(window);
    EXPECT_LT(largest(fast.first - plain.first), 1e-4) << preset;
    EXPECT_LT(largest(fast.second - plain.second), 1e-4) << preset;
  }
}

TEST(EgNetAgrees, OnAnEmptyBatch) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  const auto [A, T] = net->forward(torch::zeros({0, 3, character.num_dofs()}));
  EXPECT_EQ(A.sizes(), (std::vector<int64_t>{0, character.num_nodes(), 3}));
}

/// The character standing at the origin and facing along +z in its rest pose.
Character standing_upright(Character character) {
  const auto root = character.skeleton.root();
  for (int i = 0; i < 3; ++i) character.rest_dofs[root.translation[i]] = 0.0;
  character.rest_dofs[root.rotation[0]] = 0.0;
  return character;
}

Tensor set_gains(EgNet& net, double gain) {
  torch::NoGradGuard no_grad;
  torch::manual_seed(5);
  Tensor gains = net->named_parameters()["inertia_gain"];
  return gains.copy_(gain * torch::randn_like(gains));
}

TEST(EgNetInertia, OfAWalkAtOneSpeedIsItsResponseTimesTheWayBack) {
  const Character character = standing_upright(make_test_character());
  EgNetConfig config = small_config();
  config.inertia = 5;
  config.inertia_modes = 1;
  EgNet net(character, config);
  const auto root = character.skeleton.root();
  Tensor window = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat64).to(torch::kFloat32);
  window = window.expand({1, 6, -1}).clone();
  const double speed = 0.03;  // metres a frame, along x
  for (int frame = 0; frame < 6; ++frame)
    window[0][frame][root.translation[0]] += speed * frame / root.translation_weight[0];
  EXPECT_EQ(largest(net->inertia(window)), 0.0) << "a node trails by nothing until it has learnt to";

  const int64_t K = net->num_nodes();
  const Tensor gains = set_gains(net, 1.0).detach().to(torch::kFloat64).view({2, K});
  const double rate = std::exp(net->named_parameters()["inertia_decay"][0].item<double>());
  const double frequency = net->named_parameters()["inertia_frequency"][0].item<double>();
  Tensor expected = torch::zeros({K}, torch::kFloat64);
  for (int j = 1; j <= 5; ++j)
    expected -=
        speed * j * std::exp(-rate * j) * (gains[0] * std::cos(frequency * j) + gains[1] * std::sin(frequency * j));
  const Tensor found = net->inertia(window)[0];
  EXPECT_LT(largest(found.select(1, 0) - expected), 1e-5);
  EXPECT_LT(largest(found.narrow(1, 1, 2)), 1e-5);
  EXPECT_GT(largest(found), 0.01);
}

TEST(EgNetInertia, FollowsTheTruePathWhateverTheNetworkSees) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  config.inertia = 4;
  EgNet net(character, config);
  set_gains(net, 0.3);
  net->eval();
  const Tensor path = random_windows(character, 3, 5), seen = path + 0.05 * torch::randn_like(path);
  const Tensor still = path.narrow(1, 4, 1).expand({-1, 5, -1});
  EXPECT_LT(largest(net->inertia(still)), 1e-5);
  const auto [A, T] = net->forward(seen, path);
  const auto [still_A, still_T] = net->forward(seen, still);
  EXPECT_TRUE(torch::equal(A, still_A));
  EXPECT_LT(largest(T - still_T - net->inertia(path)), 1e-5);
  EXPECT_GT(largest(net->inertia(path)), 1e-3);
  EXPECT_LT(largest(net->inertia(turned_and_moved(character, path, 1.3)) - net->inertia(path)), 1e-4);
}

TEST(EgNetInertia, LearnsASpringThatItHasNotBeenTold) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  config.inertia = 8;
  EgNet teacher(character, config), pupil(character, config);
  set_gains(teacher, 0.3);
  const Tensor windows = random_windows(character, 16, 9);
  const Tensor target = teacher->inertia(windows).detach();
  std::vector<Tensor> learnt;
  for (const auto& item : pupil->named_parameters())
    if (item.key().find("inertia") == 0) learnt.push_back(item.value());
  ASSERT_EQ(learnt.size(), 3u);
  {
    torch::NoGradGuard no_grad;
    pupil->named_parameters()["inertia_frequency"].mul_(1.3);
  }
  torch::optim::Adam adam(learnt, torch::optim::AdamOptions(1e-2));
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 400; ++step) {
    adam.zero_grad();
    const Tensor loss = (pupil->inertia(windows) - target).square().mean();
    loss.backward();
    adam.step();
    last = loss.item<double>();
    if (step == 0) first = last;
  }
  EXPECT_LT(last, 0.01 * first);
}

TEST(EgNetInertia, IsRefusedWhereThereIsNone) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  EXPECT_THROW(net->inertia(random_windows(character, 1)), UsageError);
  EgNetConfig config = small_config();
  config.inertia = 6;
  EXPECT_EQ(config.history(), 6);
  EXPECT_THROW(EgNet(character, config)->forward(random_windows(character, 1)), UsageError) << "too short a window";
  config.inertia = -1;
  EXPECT_THROW(EgNet(character, config), UsageError);
}

TEST(EgNetAgrees, AsATraceOnBatchesItHasNotSeen) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  config.sagcn.head_scale = 0.3;
  config.inertia = 2;
  EgNet net(character, config);
  set_gains(net, 0.3);
  net->eval();
  for (Tensor parameter : net->parameters()) parameter.set_requires_grad(false);  // here they become constants
  const Tensor example = random_windows(character, 2);
  const auto traced = torch::jit::tracer::trace(
      {example},
      [&](torch::jit::Stack stack) -> torch::jit::Stack {
        const auto [A, T] = net->forward(stack[0].toTensor());
        return {A, T};
      },
      [](const torch::autograd::Variable&) { return ""; });
  torch::jit::GraphExecutor executor(traced.first->graph, "egnet");
  for (const torch::jit::Node* node : traced.first->graph->nodes())
    EXPECT_NE(std::string(node->kind().ns().toUnqualString()), "doppel") << "an op of our own in the trace";
  for (const int64_t batch : {1, 5}) {
    const Tensor window = turned_and_moved(character, random_windows(character, batch), 1.1);
    torch::jit::Stack stack{window};
    executor.run(stack);
    const auto [A, T] = net->forward(window);
    EXPECT_LT(largest(stack[0].toTensor() - A), 1e-6) << "batch " << batch;
    EXPECT_LT(largest(stack[1].toTensor() - T), 1e-6) << "batch " << batch;
  }
}

TEST(EgNetRecovers, ADeformationDrivenByTheMotion) {
  const Character character = make_test_character();
  EgNetConfig config = small_config();
  EgNet net(character, config);
  const Tensor windows = random_windows(character, 12);
  const Tensor features = net->node_features(windows);
  net->set_input_statistics(features.mean(0), features.std(0));
  // The cloth trails behind: a function of the velocity.
  const Tensor target = 0.1 * (features.narrow(2, 12, 3) - features.narrow(2, 6, 3));
  torch::optim::Adam adam(net->parameters(), torch::optim::AdamOptions(2e-3));
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 150; ++step) {
    adam.zero_grad();
    const auto [A, T] = net->forward(windows);
    const Tensor loss = (T - target).square().mean() + A.square().mean();
    loss.backward();
    adam.step();
    last = loss.item<double>();
    if (step == 0) first = last;
  }
  EXPECT_LT(last, 0.02 * first) << "12 windows should be learned by heart";
}

TEST(EgNetRecovers, ItsStateFromAnArchive) {
  const Character character = make_test_character();
  EgNet net(character, small_config());
  const Tensor windows = random_windows(character, 4);
  const Tensor features = net->node_features(windows);
  net->set_input_statistics(features.mean(0), features.std(0));
  net->forward(windows);  // moves the running statistics
  net->eval();
  const auto expected = net->forward(windows);

  std::stringstream file;
  torch::serialize::OutputArchive out;
  net->save(out);
  out.save_to(file);
  EgNet other(character, small_config(), at::detail::createCPUGenerator(99));
  torch::serialize::InputArchive in;
  in.load_from(file);
  other->load(in);
  other->eval();
  const auto found = other->forward(windows);
  EXPECT_TRUE(torch::equal(expected.first, found.first));
  EXPECT_TRUE(torch::equal(expected.second, found.second));
}

TEST(EgNetConfigReference, ReadsPresetsAndChangesOfThem) {
  const auto read = [](const std::string& text) {
    const ConfigDocument document = ConfigDocument::parse(text, "egnet.yaml");
    const ConfigReader root = document.root();
    const EgNetConfig config = read_options<EgNetConfig>(root);
    root.finish();
    return config;
  };
  const EgNetConfig paper = read("preset: paper");
  EXPECT_EQ(paper.sagcn.rings, 3);
  EXPECT_EQ(paper.sagcn.features, 16);
  EXPECT_EQ(paper.sagcn.residual_blocks, 8);
  EXPECT_EQ(paper.num_inputs(), 18);
  EXPECT_EQ(read("preset: public_checkpoint").sagcn.rings, 2);
  const EgNetConfig changed = read("past_frames: 3\nrotation: rotation_6d\nnorm: channel\ndense: matrix\nrings: 4");
  EXPECT_EQ(changed.num_inputs(), 36);
  EXPECT_EQ(changed.sagcn.norm, SagcnNorm::channel);
  EXPECT_EQ(changed.sagcn.dense, DenseBlock::matrix);
  EXPECT_EQ(changed.sagcn.rings, 4);
}

TEST(EgNetConfigRejects, MistakesWithFileAndKey) {
  const auto message = [](const std::string& text) -> std::string {
    return support::message_of<Error>([&] {
      const ConfigDocument document = ConfigDocument::parse(text, "egnet.yaml");
      const ConfigReader root = document.root();
      read_options<EgNetConfig>(root);
      root.finish();
    });
  };
  EXPECT_THAT(message("residual_blocks: 3"), HasSubstr("residual_blocks"));
  EXPECT_THAT(message("norm: batch"), HasSubstr("norm"));
  EXPECT_THAT(message("ring: 3"), HasSubstr("rings"));
}

TEST(EgNetConfigRejects, KeysThatTheNetworkDoesNotRead) {
  const auto message = [](const std::string& text) -> std::string {
    const ConfigDocument document = ConfigDocument::parse(text, "egnet.yaml");
    return support::message_of([&] { read_options<EgNetConfig>(document.root()); });
  };
  for (const char* key : {"features: 8", "residual_blocks: 4", "rings: 2", "norm: channel", "dense: broadcast",
                          "dense_normalised: false", "rotation: rotation_6d", "chebyshev_order: 4"}) {
    const std::string name = std::string(key).substr(0, std::string(key).find(':'));
    EXPECT_THAT(message(std::string("network: fully_connected\n") + key),
                AllOf(HasSubstr("egnet.yaml:2"), HasSubstr(name), HasSubstr("leave")));
  }
  for (const char* key : {"rings: 2", "dense_normalised: false"})
    EXPECT_THAT(message(std::string("network: chebyshev\n") + key), HasSubstr("`network: chebyshev` does not read"));
  EXPECT_THAT(message("{network: chebyshev, dense: matrix}"), HasSubstr("set dense: broadcast or none"));
  EXPECT_THAT(message("chebyshev_order: 2"), HasSubstr("set network: chebyshev"));
  EXPECT_THAT(message("dense_normalised: false"), HasSubstr("set dense: broadcast"));
  EXPECT_THAT(message("inertia_modes: 3"), HasSubstr("set inertia to a number of past frames"));
  EXPECT_THAT(message("{preset: public_checkpoint, head_scale: 0.1}"), HasSubstr("set preset: paper"));
  for (const char* fine :
       {"{network: fully_connected, features: 16, rings: 3, norm: node, head_scale: 0.1, rotation: euler}",
        "{network: chebyshev, chebyshev_order: 4, features: 8, dense: broadcast}", "{inertia: 4, inertia_modes: 3}",
        "inertia_modes: 2", "{preset: public_checkpoint, network: fully_connected, rings: 2}",
        "{dense: broadcast, dense_normalised: false}"})
    EXPECT_EQ(message(fine), "nothing was thrown") << fine;
}

}  // namespace
}  // namespace doppel::egnet_test
