#include "doppel/layers/embedded_deformation/embedded_deformation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "doppel/layers/surface.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::embedded_deformation_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

const Character& actor() {
  static const Character character = make_test_character(5, 7, 15);
  return character;
}

struct Inputs {
  std::vector<Tensor> tensors;  // A, T, D, node transforms
};

Inputs random_inputs(int64_t batch, torch::ScalarType type, double distance = 0.0) {
  const int64_t K = actor().num_nodes(), N = actor().num_vertices();
  const Tensor rigid = random_transforms(batch, 1, 1.0, 4);
  Tensor transforms = (rigid + 0.1 * random_transforms(batch, K, 1.0, 8)).contiguous();
  transforms.select(-1, 3) += distance;
  Inputs inputs;
  for (const Tensor& value : {0.5 * random_numbers({batch, K, 3}, 1), 0.1 * random_numbers({batch, K, 3}, 2),
                              0.05 * random_numbers({batch, N, 3}, 3), transforms}) {
    // Both precisions see the same numbers.
    inputs.tensors.push_back(leaf(value.to(torch::kFloat32), type));
  }
  return inputs;
}

/// Which of D and the node transforms are given.
struct Form {
  bool displaced, posed;
};
const Form kForms[] = {{false, false}, {true, false}, {false, true}, {true, true}};

Tensor deform(EmbeddedDeformation& layer, const std::vector<Tensor>& x, Form form) {
  return layer->forward(x[0], x[1], form.displaced ? x[2] : Tensor(), form.posed ? x[3] : Tensor());
}

TEST(EulerReference, IsRzRyRx) {
  const Tensor angles = random_numbers({20, 3}, 1), matrices = euler_to_matrix(angles);
  for (int i = 0; i < 20; ++i) {
    const double* a = angles[i].data_ptr<double>();
    const Eigen::Matrix3d expected =
        (Eigen::AngleAxisd(a[2], Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(a[1], Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(a[0], Eigen::Vector3d::UnitX()))
            .toRotationMatrix();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(matrices[i][r][c].item<double>(), expected(r, c), 1e-14);
    }
  }
}

TEST(EulerReference, MatricesComeBackAsTheirAngles) {
  const Tensor angles = torch::tensor({{0.3, -1.2, 3.0}, {-3.1, 1.5, -2.0}, {0.0, 0.0, 0.0}}, torch::kFloat64);
  EXPECT_TRUE(is_near(matrix_to_euler(euler_to_matrix(angles)), angles, 1e-12));
}

TEST(EulerReference, AtThePoleTheMatrixIsKeptAndGradientsAreFinite) {
  for (double pole : {M_PI / 2, -M_PI / 2}) {
    const Tensor matrix = leaf(euler_to_matrix(torch::tensor({{0.4, pole, 0.9}}, torch::kFloat64)), torch::kFloat64);
    const Tensor angles = matrix_to_euler(matrix);
    EXPECT_TRUE(is_near(euler_to_matrix(angles), matrix, 1e-6));
    angles.sum().backward();
    EXPECT_TRUE(torch::isfinite(matrix.grad()).all().item<bool>());
  }
}

TEST(EulerGradient, EqualsCentralDifferences) {
  const Tensor angles = 0.5 * random_numbers({10, 3}, 1);
  EXPECT_TRUE(gradients_match([](const auto& x) { return euler_to_matrix(x[0]); }, {{"angles", angles}}));
  EXPECT_TRUE(
      gradients_match([](const auto& x) { return matrix_to_euler(x[0]); }, {{"rotation", euler_to_matrix(angles)}}));
}

TEST(EmbeddedDeformationReference, EqualsTheSumsOfTheEquation) {
  EmbeddedDeformation layer(actor());
  const Inputs in = random_inputs(2, torch::kFloat64);
  const Tensor found = deform(layer, in.tensors, {true, true});
  const EmbeddedGraph& graph = actor().graph;
  const Tensor rotation = euler_to_matrix(in.tensors[0]);
  const auto R = rotation.accessor<double, 4>();
  const auto T = in.tensors[1].accessor<double, 3>(), D = in.tensors[2].accessor<double, 3>();
  const auto M = in.tensors[3].accessor<double, 4>();
  for (int b = 0; b < 2; ++b) {
    for (int i = 0; i < actor().num_vertices(); i += 5) {
      Eigen::Vector3d y(D[b][i][0], D[b][i][1], D[b][i][2]), x = Eigen::Vector3d::Zero();
      for (int e = graph.vertex_nodes.offsets[i]; e < graph.vertex_nodes.offsets[i + 1]; ++e) {
        const int k = graph.vertex_nodes.items[e];
        const Eigen::Vector3d g = actor().mesh.vertices[graph.node_vertex[k]], d = actor().mesh.vertices[i] - g;
        for (int r = 0; r < 3; ++r) {
          y[r] += graph.weights[e] *
                  (R[b][k][r][0] * d[0] + R[b][k][r][1] * d[1] + R[b][k][r][2] * d[2] + g[r] + T[b][k][r]);
        }
      }
      for (int e = graph.vertex_nodes.offsets[i]; e < graph.vertex_nodes.offsets[i + 1]; ++e) {
        const int k = graph.vertex_nodes.items[e];
        for (int r = 0; r < 3; ++r) {
          x[r] +=
              graph.weights[e] * (M[b][k][r][0] * y[0] + M[b][k][r][1] * y[1] + M[b][k][r][2] * y[2] + M[b][k][r][3]);
        }
      }
      for (int r = 0; r < 3; ++r) EXPECT_NEAR(found[b][i][r].item<double>(), x[r], 1e-12);
    }
  }
}

TEST(EmbeddedDeformationReference, WithoutDeformationTheTemplateStays) {
  EmbeddedDeformation layer(actor());
  const Tensor none = torch::zeros({3, actor().num_nodes(), 3});
  const Tensor rest = layer->graph().rest;
  EXPECT_TRUE(is_near(layer->forward(none, none), rest.expand({3, -1, 3}), 2.5e-7));  // an ulp at 2 m
}

TEST(EmbeddedDeformationAgrees, KernelEqualsReference) {
  EmbeddedDeformation layer(actor());
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    for (int64_t batch : {0, 1, 3, 5, 9, 17, 33}) {
      for (Form form : kForms) {
        const Tensor found = deform(layer, random_inputs(batch, torch::kFloat32).tensors, form);
        const Tensor expected = deform(layer, random_inputs(batch, torch::kFloat64).tensors, form);
        EXPECT_TRUE(is_near(found, expected, 2e-6)) << "batch " << batch << ", threads " << threads;
      }
    }
  }
}

TEST(EmbeddedDeformationAgrees, FarFromTheOrigin) {
  EmbeddedDeformation layer(actor());
  const Tensor found = deform(layer, random_inputs(3, torch::kFloat32, 7.0).tensors, {true, true});
  EXPECT_TRUE(is_near(found, deform(layer, random_inputs(3, torch::kFloat64, 7.0).tensors, {true, true}), 3e-6));
}

TEST(EmbeddedDeformationAgrees, LargeAngles) {
  EmbeddedDeformation layer(actor());
  for (double scale : {30.0, 2000.0, 1e5}) {
    Inputs single = random_inputs(3, torch::kFloat32), exact = random_inputs(3, torch::kFloat64);
    single.tensors[0] = (single.tensors[0] * scale).detach();
    exact.tensors[0] = single.tensors[0].to(torch::kFloat64);
    EXPECT_TRUE(
        is_near(deform(layer, single.tensors, {false, false}), deform(layer, exact.tensors, {false, false}), 2e-6));
  }
}

TEST(EmbeddedDeformationAgrees, KernelGradientEqualsReference) {
  const char* names[] = {"A", "T", "D", "node_transforms"};
  EmbeddedDeformation layer(actor());
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    for (int64_t batch : {0, 1, 5, 17}) {
      for (Form form : kForms) {
        const Inputs single = random_inputs(batch, torch::kFloat32), exact = random_inputs(batch, torch::kFloat64);
        const Tensor probe = random_numbers({batch, actor().num_vertices(), 3}, 5);
        const auto found = test::gradients_of(deform(layer, single.tensors, form), probe, single.tensors);
        const auto expected = test::gradients_of(deform(layer, exact.tensors, form), probe, exact.tensors);
        for (int i = 0; i < 4; ++i)
          EXPECT_TRUE(is_near(found[i], expected[i], 2e-5, 1e-5)) << names[i] << ", batch " << batch;
      }
    }
  }
}

TEST(EmbeddedDeformationAgrees, GradientsAlone) {
  // Each input may be the only one that needs a gradient.
  EmbeddedDeformation layer(actor());
  const Inputs all = random_inputs(3, torch::kFloat32);
  const Tensor probe = random_numbers({3, actor().num_vertices(), 3}, 5);
  const auto expected = test::gradients_of(deform(layer, all.tensors, {true, true}), probe, all.tensors);
  for (int only = 0; only < 4; ++only) {
    std::vector<Tensor> inputs;
    for (int i = 0; i < 4; ++i) inputs.push_back(all.tensors[i].detach().clone().set_requires_grad(i == only));
    const auto found = test::gradients_of(deform(layer, inputs, {true, true}), probe, {inputs[only]});
    EXPECT_TRUE(torch::equal(found[0], expected[only])) << only;
  }
}

TEST(EmbeddedDeformationGradient, ReferenceEqualsCentralDifferences) {
  EmbeddedDeformation layer(actor());
  for (Form form : kForms) {
    const Inputs in = random_inputs(2, torch::kFloat64);
    EXPECT_TRUE(
        gradients_match([&](const auto& x) { return deform(layer, x, form); },
                        {{"A", in.tensors[0]}, {"T", in.tensors[1]}, {"D", in.tensors[2]}, {"M", in.tensors[3]}}));
  }
}

TEST(SurfaceReference, TheRestPoseIsTheTemplate) {
  CharacterSurface surface(actor());
  const Tensor rest = torch::tensor(actor().rest_dofs, torch::kFloat64).unsqueeze(0);
  const Tensor vertices = surface->embedded_deformation()->graph().rest.unsqueeze(0);
  EXPECT_TRUE(is_near(surface->skinned(rest), vertices, 1e-12));
  EXPECT_TRUE(is_near(surface->skinned_by_nodes(rest), vertices, 1e-12));
  EXPECT_TRUE(is_near(surface->skinned(rest.to(torch::kFloat32)), vertices, 2e-6));
  EXPECT_TRUE(is_near(surface->skinned_by_nodes(rest.to(torch::kFloat32)), vertices, 2e-6));
}

TEST(SurfaceGradient, ReachesPoseAndDeformation) {
  CharacterSurface surface(actor());
  const Inputs in = random_inputs(2, torch::kFloat64);
  const Tensor dofs =
      torch::tensor(actor().rest_dofs, torch::kFloat64) + 0.2 * random_numbers({2, actor().num_dofs()}, 3);
  EXPECT_TRUE(gradients_match([&](const auto& x) { return surface->deformed(x[0], x[1], x[2], x[3]); },
                              {{"dofs", dofs}, {"A", in.tensors[0]}, {"T", in.tensors[1]}, {"D", in.tensors[2]}}));
  EXPECT_TRUE(gradients_match([&](const auto& x) { return surface->skinned(x[0]); }, {{"dofs", dofs}}));
}

TEST(SurfaceAgrees, KernelGradientToThePoseEqualsReference) {
  CharacterSurface surface(actor());
  const Tensor dofs =
      (torch::tensor(actor().rest_dofs, torch::kFloat64) + 0.2 * random_numbers({3, actor().num_dofs()}, 3))
          .to(torch::kFloat32);
  const Inputs single = random_inputs(3, torch::kFloat32), exact = random_inputs(3, torch::kFloat64);
  const Tensor probe = random_numbers({3, actor().num_vertices(), 3}, 5);
  const Tensor a = leaf(dofs, torch::kFloat32), b = leaf(dofs, torch::kFloat64);
  const auto found =
      test::gradients_of(surface->deformed(a, single.tensors[0], single.tensors[1], single.tensors[2]), probe, {a});
  const auto expected =
      test::gradients_of(surface->deformed(b, exact.tensors[0], exact.tensors[1], exact.tensors[2]), probe, {b});
  EXPECT_TRUE(is_near(found[0], expected[0], 1e-3, 1e-4));
}

TEST(EmbeddedDeformationRejects, ShapesAndTypesWithTheShapeFound) {
  EmbeddedDeformation layer(actor());
  const int64_t K = actor().num_nodes();
  const Tensor good = torch::zeros({2, K, 3});
  EXPECT_THAT(message_of([&] {
                layer->forward(torch::zeros({2, K + 1, 3}), good);
              }),
              testing::AllOf(testing::HasSubstr("A must be"), testing::HasSubstr(std::to_string(K + 1))));
  EXPECT_THAT(message_of([&] { layer->forward(good, torch::zeros({3, K, 3})); }), testing::HasSubstr("T must be"));
  EXPECT_THAT(message_of([&] {
                layer->forward(good, good, torch::zeros({2, K, 3}));
              }),
              testing::HasSubstr("D must be"));
  EXPECT_THAT(message_of([&] {
                layer->forward(good, good, {}, torch::zeros({2, K, 4, 4}));
              }),
              testing::HasSubstr("node_transforms must be"));
  EXPECT_THAT(message_of([&] { layer->forward(good, good.to(torch::kFloat64)); }), testing::HasSubstr("convert"));
}

TEST(EmbeddedDeformationRejects, ASecondDerivativeOfTheKernel) {
  EmbeddedDeformation layer(actor());
  const Inputs in = random_inputs(1, torch::kFloat32);
  const Tensor loss = deform(layer, in.tensors, {true, true}).square().sum();
  const Tensor gradient = torch::autograd::grad({loss}, {in.tensors[0]}, {}, true, /*create_graph=*/true)[0];
  EXPECT_THAT(message_of([&] { gradient.square().sum().backward(); }), testing::HasSubstr("no second derivative"));
}

}  // namespace
}  // namespace doppel::embedded_deformation_test
