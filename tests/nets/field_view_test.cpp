#include "doppel/nets/field_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "doppel/nets/hybrid.h"
#include "doppel/nets/plain_field.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::field_view_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;
using torch::Tensor;

RadianceFieldConfig small_field() {
  RadianceFieldConfig config;
  config.features = 4;
  config.layers = 2;
  config.width = 16;
  config.view_width = 8;
  return config;
}

struct Scene {
  Character character = make_test_character();
  RadianceField field{small_field()};
  FieldSurface surface;
  Scene() {
    surface.vertices = torch::empty({character.num_vertices(), 3});
    for (int i = 0; i < character.num_vertices(); ++i)
      for (int k = 0; k < 3; ++k) surface.vertices[i][k] = static_cast<float>(character.mesh.vertices[i][k]);
    surface.values = torch::randn({character.num_vertices(), 4}, at::detail::createCPUGenerator(3));
    // Dense everywhere: what is seen is the shell around the mesh.
    const torch::NoGradGuard no_grad;
    field->named_parameters()["density.bias"].fill_(20.0);
  }
  Tensor centre() const { return surface.vertices.mean(0); }
  /// Looks along -z from 3 m in front of the middle. @return [3,4] for images of `size` pixels a side
  Tensor front(double size) const {
    const Tensor turn = torch::tensor({{1.0f, 0.0f, 0.0f}, {0.0f, -1.0f, 0.0f}, {0.0f, 0.0f, -1.0f}});
    const Tensor eye = centre() + torch::tensor({0.0f, 0.0f, 3.0f});
    const auto f = static_cast<float>(1.5 * size), c = static_cast<float>(0.5 * size);
    const Tensor K = torch::tensor({{f, 0.0f, c}, {0.0f, f, c}, {0.0f, 0.0f, 1.0f}});
    return K.matmul(torch::cat({turn, -turn.matmul(eye).unsqueeze(1)}, 1)).contiguous();
  }
};

TEST(FieldViewer, ShowsTheShellAroundTheMesh) {
  Scene scene;
  FieldViewer viewer(scene.character);
  const int64_t size = 64;
  const FieldImage seen = viewer.draw(scene.field, scene.surface, scene.front(size), size, size, 5);
  const GuideImages guide =
      viewer.guide(scene.surface.vertices, scene.front(size).unsqueeze(0), size, size, guide_of(small_field(), 5));
  const Tensor covered = guide.face_id[0] >= 0;
  EXPECT_GT(seen.opacity.masked_select(covered).min().item<float>(), 0.99f);
  EXPECT_EQ(seen.opacity.masked_select(~guide.reached[0]).abs().sum().item<float>(), 0.0f);
  EXPECT_EQ(seen.colour.masked_select(~guide.reached[0].unsqueeze(2)).abs().sum().item<float>(), 0.0f);
  // So dense a field is seen where its shell begins: a little before the surface.
  const Tensor before = (guide.distance[0] - seen.depth).masked_select(covered);
  EXPECT_GT(before.median().item<float>(), 0.03f);
  EXPECT_LT(before.median().item<float>(), 0.07f);
}

TEST(FieldViewer, RefusesAnOpenTemplate) {
  Scene scene;
  scene.character.mesh.faces.pop_back();
  EXPECT_THAT(message_of([&] { FieldViewer viewer(scene.character); }), HasSubstr("edge"));
}

TEST(FieldViewer, RefusesACameraInsideTheMesh) {
  Scene scene;
  FieldViewer viewer(scene.character);
  Tensor inside = scene.front(32).clone();
  const Tensor K = torch::tensor({{48.0f, 0.0f, 16.0f}, {0.0f, 48.0f, 16.0f}, {0.0f, 0.0f, 1.0f}});
  const Tensor eye = scene.surface.vertices.slice(0, 0, 8).mean(0) + torch::tensor({0.0f, 0.3f, 0.0f});
  const Tensor turn = torch::tensor({{1.0f, 0.0f, 0.0f}, {0.0f, -1.0f, 0.0f}, {0.0f, 0.0f, -1.0f}});
  inside = K.matmul(torch::cat({turn, -turn.matmul(eye).unsqueeze(1)}, 1)).contiguous();
  EXPECT_THAT(message_of([&] { viewer.draw(scene.field, scene.surface, inside, 32, 32, 5); }),
              HasSubstr("inside the mesh"));
}

TEST(Hybrid, BeginsAsDeltaNetAndFollowsWhenTold) {
  const Character character = make_test_character();
  DeltaNetConfig small;
  small.sagcn.features = 4;
  small.sagcn.residual_blocks = 2;
  small.sagcn.head_scale = 0.01;
  DeltaNet deltanet(character, small, at::detail::createCPUGenerator(8));
  HybridConfig config;
  config.motion.sagcn.features = 4;
  config.motion.sagcn.residual_blocks = 2;
  config.field = small_field();
  Hybrid hybrid(character, deltanet, config);
  const Tensor window = torch::zeros({1, small.past_frames + 1, character.num_dofs()});
  const Tensor start = deltanet->forward(window);
  EXPECT_TRUE(torch::equal(hybrid->refined->forward(window), start));
  EXPECT_TRUE(torch::equal(hybrid->around->forward(window), start));
  EXPECT_EQ(hybrid->motion->forward(window).sizes(), at::IntArrayRef({1, character.num_vertices(), 4}));
  EXPECT_GT(hybrid->motion->forward(window).std().item<float>(), 1e-3f);
  {
    const torch::NoGradGuard no_grad;
    for (Tensor& parameter : hybrid->refined->parameters()) parameter.add_(0.01);
  }
  EXPECT_FALSE(torch::equal(hybrid->refined->forward(window), start));
  EXPECT_TRUE(torch::equal(hybrid->around->forward(window), start));
  hybrid->follow();
  EXPECT_TRUE(torch::equal(hybrid->around->forward(window), hybrid->refined->forward(window)));
  for (const Tensor& parameter : hybrid->around->parameters()) EXPECT_FALSE(parameter.requires_grad());
  for (const Tensor& parameter : hybrid->refined->parameters()) EXPECT_TRUE(parameter.requires_grad());
}

TEST(Hybrid, VerticesCarryFeaturesAndPositions) {
  const Character character = make_test_character();
  DeltaNetConfig small;
  small.sagcn.features = 4;
  small.sagcn.residual_blocks = 2;
  DeltaNet deltanet(character, small, at::detail::createCPUGenerator(8));
  HybridConfig config;
  config.motion.sagcn = small.sagcn;
  config.field = small_field();
  const Tensor window = torch::zeros({1, config.motion.past_frames + 3, character.num_dofs()});
  EXPECT_EQ(Hybrid(character, deltanet, config)->vertex_values(window).size(1), 4);
  config.field.place_octaves = 2;
  const Tensor values = Hybrid(character, deltanet, config)->vertex_values(window);
  ASSERT_EQ(values.sizes(), at::IntArrayRef({character.num_vertices(), 7}));
  const Tensor position = values.narrow(1, 4, 3), rest = rest_vertices(character).to(torch::kFloat32);
  EXPECT_NEAR(position.abs().max().item<float>(), 1.0f, 1e-6f);
  const double scale = (position[0] - position[1]).norm().item<double>() / (rest[0] - rest[1]).norm().item<double>();
  EXPECT_TRUE(torch::allclose(position - position[0], scale * (rest - rest[0]), 1e-4, 1e-5));
}

TEST(PlainField, HasTheSizeOfItsPublicationIfAsked) {
  const ConfigDocument document = ConfigDocument::parse(
      "{position_octaves: 10, coarse: 64, fine: 128, field: {layers: 8, width: 256, skip: 5, view_width: 128}}", "c");
  const ConfigReader root = document.root();
  PlainField field(torch::eye(3), read_options<PlainFieldConfig>(root));
  root.finish();
  // The encoded position has 63 numbers, the encoded direction 27; a further input, the distance from the mesh, is
  // always 0. The published layer of 256 without activation between trunk and colours is one with the layer behind it.
  int64_t count = 0;
  for (const Tensor& p : field->parameters()) count += p.numel();
  EXPECT_EQ(count, 2 * (65 * 256 + 6 * 257 * 256 + (257 + 64) * 256 + 257 + (257 + 27) * 128 + 129 * 3));
  const ConfigDocument guided = ConfigDocument::parse("field: {t_mi: 0.1}", "c");
  const ConfigReader other = guided.root();
  read_options<PlainFieldConfig>(other);
  EXPECT_THAT(message_of([&] { other.finish(); }), HasSubstr("t_mi")) << "there is no mesh";
}

TEST(PlainField, SeesOnlyItsBox) {
  Scene scene;
  PlainFieldConfig config;
  config.field = small_field();
  config.coarse = 8;
  config.fine = 8;
  config.margin = 0.05;
  PlainField field(scene.surface.vertices, config);
  {
    const torch::NoGradGuard no_grad;
    for (const char* name : {"coarse.density.bias", "fine.density.bias"}) field->named_parameters()[name].fill_(20.0);
  }
  const Tensor middle = scene.centre(), origin = middle + torch::tensor({0.0f, 0.0f, 3.0f});
  const Tensor direction = torch::tensor({{0.0f, 0.0f, -1.0f}, {0.0f, 0.0f, 1.0f}, {0.9f, 0.0f, -0.43588989f}});
  const PlainRays rays = field->render(origin, direction);
  EXPECT_NEAR(rays.fine.opacity[0].item<float>(), 1.0f, 1e-3f);
  EXPECT_EQ(rays.fine.opacity[1].item<float>(), 0.0f);  // the box lies behind
  EXPECT_EQ(rays.fine.opacity[2].item<float>(), 0.0f);  // and beside this one
  const float face = (scene.surface.vertices.amax(0)[2] + 0.05f).item<float>();
  EXPECT_NEAR(rays.fine_samples.near[0].item<float>(), origin[2].item<float>() - face, 1e-4f);
  const FieldImage seen = field->draw(scene.front(24), 24, 24);
  EXPECT_GT(seen.opacity[12][12].item<float>(), 0.99f);
  EXPECT_EQ(seen.opacity[0][0].item<float>(), 0.0f);
}

}  // namespace
}  // namespace doppel::field_view_test
