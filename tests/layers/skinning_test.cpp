#include "doppel/layers/skinning/skinning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/tensor/reference_scope.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::skinning_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

const SkinningMode kModes[] = {SkinningMode::dual_quaternion, SkinningMode::linear};

const SkinningWeights& skin(int rings = 7) {
  static const SkinningWeights odd = make_test_character(5, 7, 7).skin, even = make_test_character(6, 8, 30).skin;
  return rings == 7 ? odd : even;
}

/// Bones that differ by up to about a radian, as a body's do, at `distance` metres from the origin.
Tensor body_bones(int64_t batch, double distance, uint64_t seed) {
  const int64_t bones = skin().num_bones();
  Tensor near = random_transforms(batch, 1, 1.0, seed).expand({batch, bones, 3, 4}).clone();
  const Tensor turn = random_numbers({batch, bones, 3}, seed + 7) * 0.4;
  Tensor skew = torch::zeros({batch, bones, 3, 3}, torch::kFloat64);
  for (int c = 0; c < 3; ++c) {
    skew.select(-2, (c + 2) % 3).select(-1, (c + 1) % 3).copy_(turn.select(-1, c));
    skew.select(-2, (c + 1) % 3).select(-1, (c + 2) % 3).copy_(-turn.select(-1, c));
  }
  near.narrow(-1, 0, 3).copy_(torch::matmul(torch::matrix_exp(skew), near.narrow(-1, 0, 3)));
  near.select(-1, 3) += distance + 0.2 * random_numbers({batch, bones, 3}, seed + 8);
  return near;
}

/// One vertex bound to two bones that turn about z by +-`degrees`.
Tensor two_bones(double degrees) {
  Tensor bones = torch::zeros({1, 2, 3, 4}, torch::kFloat64);
  for (int b = 0; b < 2; ++b) {
    const double a = (b == 0 ? 1 : -1) * degrees * M_PI / 180.0;
    bones[0][b] =
        torch::tensor({std::cos(a), -std::sin(a), 0.0, 0.0, std::sin(a), std::cos(a), 0.0, 0.0, 0.0, 0.0, 1.0, 0.0},
                      torch::kFloat64)
            .view({3, 4});
  }
  return bones;
}

SkinningWeights one_vertex(double first, double second) {
  SkinningWeights weights;
  weights.bones = {"a", "b"};
  weights.vertex_bones.offsets = {0, 2};
  weights.vertex_bones.items = {0, 1};
  weights.weights = {first, second};
  return weights;
}

TEST(SkinningReference, SignsFollowTheFirstBone) {
  // Quaternions (cos 50, +-sin 50) are more than 90 degrees apart on the sphere, so the second is negated:
  // 0.6 q1 - 0.4 q2 = (0.2 cos 50, sin 50).
  const double a = 2.0 * std::atan2(std::sin(50.0 * M_PI / 180.0), 0.2 * std::cos(50.0 * M_PI / 180.0));
  const Tensor point = torch::tensor({{1.0, 0.0, 0.3}}, torch::kFloat64);
  const Tensor expected = torch::tensor({{{std::cos(a), std::sin(a), 0.3}}}, torch::kFloat64);
  Skinning skinning(one_vertex(0.6, 0.4));
  EXPECT_TRUE(is_near(skinning->forward(point, two_bones(100.0)), expected, 1e-12));
  EXPECT_TRUE(
      is_near(skinning->forward(point.to(torch::kFloat32), two_bones(100.0).to(torch::kFloat32)), expected, 1e-6));
}

TEST(SkinningReference, LinearBlendIsTheWeightedMeanOfPositions) {
  Skinning skinning(one_vertex(0.75, 0.25), SkinningMode::linear);
  const Tensor point = torch::tensor({{1.0, 0.0, 0.3}}, torch::kFloat64);
  const double c = std::cos(M_PI / 6), s = std::sin(M_PI / 6);
  const Tensor expected = torch::tensor({{{c, 0.5 * s, 0.3}}}, torch::kFloat64);
  EXPECT_TRUE(is_near(skinning->forward(point, two_bones(30.0)), expected, 1e-12));
}

TEST(SkinningReference, EqualBonesMoveThePointsRigidly) {
  const Tensor one = random_transforms(2, 1, 3.0, 4);
  const Tensor bones = one.expand({2, skin().num_bones(), 3, 4}).contiguous();
  const Tensor points = random_numbers({skin().num_vertices(), 3}, 9);
  const Tensor expected = torch::matmul(points, one.select(1, 0).narrow(-1, 0, 3).transpose(1, 2)) +
                          one.select(1, 0).select(-1, 3).unsqueeze(1);
  for (SkinningMode mode : kModes) {
    Skinning skinning(skin(), mode);
    EXPECT_TRUE(is_near(skinning->forward(points, bones), expected, 1e-12));
    const Tensor blend = skinning->blend(bones);
    EXPECT_TRUE(is_near(blend, one.expand_as(blend), 1e-12));
  }
}

TEST(SkinningReference, OppositeBonesOfEqualWeightStayFinite) {
  // Half a turn apart the blend of equal weights may vanish; the guard keeps it finite.
  Skinning skinning(one_vertex(0.5, 0.5));
  const Tensor bones = leaf(two_bones(90.0), torch::kFloat32);
  const Tensor result = skinning->forward(torch::ones({1, 3}), bones);
  result.sum().backward();
  EXPECT_TRUE(torch::isfinite(result).all().item<bool>());
  EXPECT_TRUE(torch::isfinite(bones.grad()).all().item<bool>());
}

TEST(SkinningAgrees, KernelEqualsReference) {
  for (SkinningMode mode : kModes) {
    Skinning skinning(skin(), mode);
    const Tensor points = random_numbers({skin().num_vertices(), 3}, 1);
    for (int threads : {1, 2, 3}) {
      test::ThreadScope scope(threads);
      for (int64_t batch : {0, 1, 3, 4, 5, 8, 9, 17, 33}) {
        const Tensor bones = body_bones(batch, 0.0, 2).to(torch::kFloat32), exact = bones.to(torch::kFloat64);
        const Tensor single = points.to(torch::kFloat32);
        const Tensor own = random_numbers({batch, skin().num_vertices(), 3}, 6).to(torch::kFloat32);
        EXPECT_TRUE(
            is_near(skinning->forward(single, bones), skinning->forward(single.to(torch::kFloat64), exact), 2e-6))
            << batch;
        EXPECT_TRUE(is_near(skinning->forward(own, bones), skinning->forward(own.to(torch::kFloat64), exact), 2e-6))
            << batch;
        EXPECT_TRUE(is_near(skinning->blend(bones), skinning->blend(exact), 2e-6)) << batch;
      }
    }
  }
}

TEST(SkinningAgrees, FarFromTheOriginMicrometresRemain) {
  // The template lies within a metre or two; the body stands 7 m away in each axis.
  for (SkinningMode mode : kModes) {
    Skinning skinning(skin(), mode);
    const Tensor points = (0.5 * random_numbers({skin().num_vertices(), 3}, 1)).to(torch::kFloat32);
    const Tensor bones = body_bones(5, 7.0, 2).to(torch::kFloat32);
    EXPECT_TRUE(is_near(skinning->forward(points, bones),
                        skinning->forward(points.to(torch::kFloat64), bones.to(torch::kFloat64)), 1.5e-6));
  }
}

TEST(SkinningAgrees, RotationsOfEveryKind) {
  // All four branches of the quaternion, bones that share no neighbourhood at all.
  for (SkinningMode mode : kModes) {
    Skinning skinning(one_vertex(0.7, 0.3), mode);
    const Tensor bones = random_transforms(200, 2, 1.0, 12);
    const Tensor points = random_numbers({200, 1, 3}, 13);
    EXPECT_TRUE(is_near(skinning->forward(points.to(torch::kFloat32), bones.to(torch::kFloat32)),
                        skinning->forward(points, bones), 1e-5));
  }
}

void expect_equal_gradients(SkinningMode mode, int64_t batch, bool shared, const std::string& what) {
  Skinning skinning(skin(), mode);
  const int64_t N = skin().num_vertices();
  const Tensor points = random_numbers(shared ? std::vector<int64_t>{N, 3} : std::vector<int64_t>{batch, N, 3}, 1);
  const Tensor probe = random_numbers({batch, N, 3}, 5);
  const Tensor bones = body_bones(batch, 1.0, 2).to(torch::kFloat32);
  std::vector<Tensor> single = {leaf(points, torch::kFloat32), leaf(bones, torch::kFloat32)};
  std::vector<Tensor> exact = {leaf(single[0], torch::kFloat64), leaf(bones, torch::kFloat64)};
  const auto found = test::gradients_of(skinning->forward(single[0], single[1]), probe, single);
  const auto expected = test::gradients_of(skinning->forward(exact[0], exact[1]), probe, exact);
  EXPECT_TRUE(is_near(found[0], expected[0], 3e-5, 1e-5)) << "points, " << what;
  EXPECT_TRUE(is_near(found[1], expected[1], 3e-4, 1e-4)) << "bones, " << what;
}

TEST(SkinningAgrees, KernelGradientEqualsReference) {
  for (SkinningMode mode : kModes) {
    for (int threads : {1, 2, 3}) {
      test::ThreadScope scope(threads);
      for (int64_t batch : {0, 1, 5, 17}) {
        for (bool shared : {true, false}) {
          expect_equal_gradients(mode, batch, shared,
                                 "batch " + std::to_string(batch) + ", threads " + std::to_string(threads));
        }
      }
    }
  }
}

TEST(SkinningAgrees, BlendGradientEqualsReference) {
  for (SkinningMode mode : kModes) {
    Skinning skinning(skin(), mode);
    const Tensor bones = body_bones(6, 1.0, 2).to(torch::kFloat32);
    const Tensor single = leaf(bones, torch::kFloat32), exact = leaf(bones, torch::kFloat64);
    const Tensor blend = skinning->blend(single);
    const Tensor probe = random_numbers(blend.sizes().vec(), 5);
    EXPECT_TRUE(is_near(test::gradients_of(blend, probe, {single})[0],
                        test::gradients_of(skinning->blend(exact), probe, {exact})[0], 3e-4, 1e-4));
  }
}

TEST(SkinningAgrees, TheNumberOfThreadsChangesNoBit) {
  Skinning skinning(skin(30));
  const Tensor points = random_numbers({skin(30).num_vertices(), 3}, 1).to(torch::kFloat32);
  const Tensor bones = random_transforms(9, skin(30).num_bones(), 1.0, 3).to(torch::kFloat32);
  std::vector<Tensor> gradients;
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    const Tensor on_points = leaf(points, torch::kFloat32), on_bones = leaf(bones, torch::kFloat32);
    skinning->forward(on_points, on_bones).square().sum().backward();
    gradients.push_back(torch::cat({on_points.grad().flatten(), on_bones.grad().flatten()}));
  }
  EXPECT_TRUE(torch::equal(gradients[0], gradients[1]));
  EXPECT_TRUE(torch::equal(gradients[0], gradients[2]));
}

TEST(SkinningGradient, ReferenceEqualsCentralDifferences) {
  for (SkinningMode mode : kModes) {
    Skinning skinning(skin(), mode);
    const Tensor bones = body_bones(2, 0.5, 2), points = random_numbers({skin().num_vertices(), 3}, 1);
    EXPECT_TRUE(gradients_match([&](const auto& x) { return skinning->forward(x[0], x[1]); },
                                {{"points", points}, {"bones", bones}}, {1e-6, 1e-6, 1e-5, 60}));
    EXPECT_TRUE(gradients_match([&](const auto& x) { return skinning->blend(x[0]); }, {{"bones", bones}},
                                {1e-6, 1e-6, 1e-5, 60}));
  }
}

TEST(SkinningRejects, ShapesAndTypesWithTheShapeFound) {
  Skinning skinning(skin());
  const int64_t N = skin().num_vertices(), bones = skin().num_bones();
  const Tensor points = torch::zeros({N, 3}), good = torch::zeros({2, bones, 3, 4});
  EXPECT_THAT(message_of([&] {
                skinning->forward(points, torch::zeros({2, bones + 1, 3, 4}));
              }),
              testing::HasSubstr("bones"));
  EXPECT_THAT(message_of([&] { skinning->forward(torch::zeros({N + 1, 3}), good); }), testing::HasSubstr("points"));
  EXPECT_THAT(message_of([&] { skinning->forward(torch::zeros({3, N, 3}), good); }), testing::HasSubstr("points"));
  EXPECT_THAT(message_of([&] { skinning->forward(points.to(torch::kFloat64), good); }), testing::HasSubstr("convert"));
  EXPECT_THAT(message_of([&] { skinning->forward(Tensor(), good); }), testing::HasSubstr("undefined"));
}

TEST(SkinningRejects, WeightsThatDoNotSumToOne) {
  EXPECT_THAT(message_of([&] { Skinning skinning(one_vertex(0.6, 0.6)); }), testing::HasSubstr("sums to 1.2"));
}

TEST(SkinningRejects, ASecondDerivativeOfTheKernel) {
  Skinning skinning(skin());
  const Tensor bones = leaf(body_bones(1, 0.0, 2), torch::kFloat32);
  const Tensor loss = skinning->blend(bones).square().sum();
  const Tensor gradient = torch::autograd::grad({loss}, {bones}, {}, true, /*create_graph=*/true)[0];
  EXPECT_THAT(message_of([&] { gradient.square().sum().backward(); }), testing::HasSubstr("no second derivative"));
}

}  // namespace
}  // namespace doppel::skinning_test
