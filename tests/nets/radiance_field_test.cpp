#include "doppel/nets/radiance_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "geometry/meshes.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::radiance_field_test {
namespace {

using support::message_of;
using test::gradients_match;
using test::is_near;
using torch::Tensor;

RadianceFieldConfig small_config() {
  RadianceFieldConfig config;
  config.features = 5;
  config.layers = 2;
  config.width = 12;
  config.view_width = 7;
  config.distance_octaves = 3;
  config.direction_octaves = 2;
  return config;
}

RadianceFieldConfig with_position(RadianceFieldConfig config) {
  config.place_octaves = 4;
  return config;
}

/// A sphere of radius 0.5 with random values, and rays from all around through its neighbourhood.
struct Scene {
  TriangleMesh mesh = support::make_sphere(2, 0.5);
  ClosestPoint closest{mesh};
  FieldSurface surface;
  Tensor origin, direction, near, far;
  explicit Scene(int64_t rays, int64_t values) {
    auto generator = at::detail::createCPUGenerator(5);
    surface.vertices = torch::empty({mesh.num_vertices(), 3});
    for (int i = 0; i < mesh.num_vertices(); ++i)
      for (int k = 0; k < 3; ++k) surface.vertices[i][k] = static_cast<float>(mesh.vertices[i][k]);
    surface.values = torch::randn({mesh.num_vertices(), values}, generator);
    origin = torch::tensor({0.0f, 0.0f, -2.0f});
    const Tensor target = 1.1 * (torch::rand({rays, 3}, generator) - 0.5);
    direction = target - origin;
    direction = direction / direction.norm(2, {1}, true);
    near = torch::full({rays}, 1.4);
    far = torch::full({rays}, 1.7) + 0.4 * torch::rand({rays}, generator);
    far[0] = near[0];  // an empty one
  }
};

TEST(PositionalEncoding, OctavesOfSinesAndCosines) {
  const Tensor x = torch::tensor({{0.25, -0.5}}, torch::kFloat64);
  const double s = std::sqrt(0.5);
  const Tensor expected = torch::tensor({{0.25, -0.5, s, -1.0, s, 0.0, 1.0, 0.0, 0.0, -1.0}}, torch::kFloat64);
  EXPECT_TRUE(is_near(positional_encoding(x, 2), expected, 1e-12));
  EXPECT_TRUE(torch::equal(positional_encoding(x, 0), x));
}

TEST(RadianceField, HasTheShapeOfThePaper) {
  RadianceField field{RadianceFieldConfig()};
  EXPECT_EQ(field->num_inputs(), 85);
  int64_t count = 0;
  for (const Tensor& p : field->parameters()) count += p.numel();
  EXPECT_EQ(count, 86 * 256 + 3 * 257 * 256 + 257 + 257 * 128 + 27 * 128 + 129 * 3);
  const FieldValues values = field->forward(torch::randn({50, 64}), torch::rand({50}), torch::randn({50, 3}));
  EXPECT_GE(values.density.min().item<float>(), 0.0f);
  EXPECT_GT(values.density.max().item<float>(), 1.0f);
  EXPECT_TRUE(((values.colour > 0) & (values.colour < 1)).all().item<bool>());
}

TEST(RadianceField, BeginsTheSameWithTheSameGenerator) {
  RadianceField a(small_config()), b(small_config()), c(small_config(), at::detail::createCPUGenerator(9));
  EXPECT_TRUE(torch::equal(a->parameters()[0], b->parameters()[0]));
  EXPECT_FALSE(torch::equal(a->parameters()[0], c->parameters()[0]));
}

// Features that say nothing: without the position the field is one colour, with it an image finer than the mesh.
TEST(RadianceField, SeesThePositionWithinAFace) {
  RadianceFieldConfig config = small_config();
  for (const bool positions : {false, true}) {
    if (positions) config = with_position(config);
    RadianceField field(config);
    const Tensor values =
        torch::cat({torch::ones({9, 5}), torch::linspace(0.1, 0.2, 9).unsqueeze(1).expand({9, 3})}, 1);
    const Tensor colour =
        field->forward(values.narrow(1, 0, config.vertex_values()), torch::zeros({9}), torch::ones({9, 3})).colour;
    EXPECT_EQ((colour - colour[0]).abs().max().item<float>() > 1e-2f, positions);
  }
}

TEST(RadianceField, ASkipJoinsTheInputsToALayer) {
  RadianceFieldConfig config = small_config();
  config.layers = 3;
  config.skip = 2;
  config.view_dependent = false;
  RadianceField field(config);
  const auto weights = field->named_parameters();
  const int64_t inputs = field->num_inputs();
  EXPECT_EQ(weights["trunk.1.weight"].sizes(), torch::IntArrayRef({12, 12}));
  EXPECT_EQ(weights["trunk.2.weight"].sizes(), torch::IntArrayRef({12, inputs + 12}));
  const auto generator = at::detail::createCPUGenerator(3);
  const Tensor values = torch::randn({6, 5}, generator), distance = torch::rand({6}, generator);
  const Tensor input = torch::cat({values, positional_encoding(distance.unsqueeze(1), 3)}, 1);
  const auto layer = [&](const std::string& name, const Tensor& x) {
    return torch::addmm(weights[name + ".bias"], x, weights[name + ".weight"].t());
  };
  const Tensor hidden = layer("trunk.1", layer("trunk.0", input).relu()).relu();
  const Tensor last = layer("trunk.2", torch::cat({input, hidden}, 1)).relu();
  const Tensor expected = torch::softplus(layer("density", last)).squeeze(1) / config.density_unit;
  EXPECT_TRUE(is_near(field->forward(values, distance, torch::zeros({6, 3})).density, expected, 1e-4));
  EXPECT_THAT(message_of([&] { field->image_layers(); }), testing::HasSubstr("skip"));
  config.skip = 3;
  EXPECT_THAT(message_of<UsageError>([&] { RadianceField other(config); }), testing::HasSubstr("before the last of 3"));
}

TEST(RadianceField, ColoursDependOnTheDirectionOnlyIfAsked) {
  RadianceFieldConfig config = small_config();
  for (const bool dependent : {false, true}) {
    config.view_dependent = dependent;
    RadianceField field(config);
    const Tensor values = torch::ones({2, config.features}), distance = torch::zeros({2});
    const FieldValues seen = field->forward(values, distance, torch::eye(3).narrow(0, 0, 2));
    EXPECT_EQ(torch::equal(seen.colour[0], seen.colour[1]), !dependent);
    EXPECT_TRUE(torch::equal(seen.density[0], seen.density[1]));
    EXPECT_EQ(field->named_parameters().contains("view_of_direction.weight"), dependent);
  }
}

TEST(RadianceField, Gradients) {
  auto generator = at::detail::createCPUGenerator(3);
  const auto random = [&](std::vector<int64_t> shape) { return torch::randn(shape, generator, torch::kFloat64); };
  for (const RadianceFieldConfig& config : {small_config(), with_position(small_config())}) {
    RadianceField field(config);
    field->to(torch::kFloat64);
    EXPECT_TRUE(gradients_match(
        [&](const std::vector<Tensor>& in) {
          const FieldValues values = field->forward(in[0], in[1], in[2]);
          return torch::cat({values.density.unsqueeze(1) * 0.01, values.colour}, 1);
        },
        {{"values", random({6, config.vertex_values()})},
         {"distance", 0.5 * random({6})},
         {"direction", random({6, 3})}}));
  }
}

// End to end: through closest points, interpolation, field and volume rendering to the vertices.
TEST(RenderField, GradientsToSurfaceAndIntervals) {
  const Scene scene(6, 5);
  RadianceField field(small_config());
  field->to(torch::kFloat64);
  const auto d = [](const Tensor& t) { return t.to(torch::kFloat64); };
  EXPECT_TRUE(gradients_match(
      [&](const std::vector<Tensor>& in) {
        const RenderedRays seen = render_field(field, scene.closest, {in[0], in[1]}, d(scene.origin),
                                               d(scene.direction), sample_cells(in[2], in[3], 5));
        return torch::cat({seen.colour, seen.opacity.unsqueeze(1), seen.depth.unsqueeze(1)}, 1);
      },
      {{"vertices", d(scene.surface.vertices)},
       {"values", d(scene.surface.values)},
       {"near", d(scene.near)},
       {"far", d(scene.far)}},
      {1e-7, 1e-6, 1e-4}));
}

void expect_drawn_as_rendered(const RadianceFieldConfig& config) {
  const Scene scene(300, config.vertex_values());
  RadianceField field{config};
  const RenderedRays expected = render_field(field, scene.closest, scene.surface, scene.origin, scene.direction,
                                             sample_cells(scene.near, scene.far, 32));
  FieldImageOptions options;
  options.samples = 32;
  options.first_pass = 1;  // all samples
  const auto draw = [&] {
    return draw_field(field, scene.closest, scene.surface, scene.origin, scene.direction, scene.near, scene.far,
                      options);
  };
  const FieldPixels image = draw();
  EXPECT_TRUE(is_near(image.colour, expected.colour, 5e-4));
  EXPECT_TRUE(is_near(image.opacity, expected.opacity, 2e-4));
  EXPECT_TRUE(is_near(image.depth, expected.depth, 1e-3));
  EXPECT_FALSE(image.colour.requires_grad());
  options.rays_at_once = 77;
  const int threads = at::get_num_threads();
  at::set_num_threads(3);
  const FieldPixels other = draw();
  at::set_num_threads(threads);
  EXPECT_TRUE(torch::equal(image.colour, other.colour));
  EXPECT_TRUE(torch::equal(image.opacity, other.opacity));
  EXPECT_TRUE(torch::equal(image.depth, other.depth));
  EXPECT_EQ(expected.opacity[0].item<float>(), 0.0f);
  EXPECT_GT(expected.opacity.max().item<float>(), 0.5f);
}

TEST(DrawField, EqualsRenderField) {
  expect_drawn_as_rendered({});
  expect_drawn_as_rendered(with_position({}));
  RadianceFieldConfig same_from_everywhere;
  same_from_everywhere.view_dependent = false;
  expect_drawn_as_rendered(same_from_everywhere);
}

/// As a trained field: empty outside of the surface and opaque inside.
RadianceField solid_field() {
  RadianceFieldConfig config;
  RadianceField field{config};
  torch::NoGradGuard no_grad;
  auto weights = field->named_parameters();
  weights["trunk.0.weight"][0].zero_();
  weights["trunk.0.weight"][0][config.features] = -1.0;  // of the distance
  weights["trunk.0.bias"][0] = 0.2;
  for (int layer = 1; layer < config.layers; ++layer) {
    const std::string name = "trunk." + std::to_string(layer);
    weights[name + ".weight"][0].zero_();
    weights[name + ".weight"][0][0] = 1.0;
  }
  weights["density.weight"].zero_();
  weights["density.weight"][0][0] = 40.0;
  weights["density.bias"].fill_(-10.0);
  return field;
}

TEST(DrawField, IsAlmostTheSameWithoutSamplesInEmptySpaceAndBehindTheSurface) {
  const Scene scene(300, 64);
  RadianceField field = solid_field();
  FieldImageOptions options;
  options.first_pass = 1;
  const auto draw = [&] {
    return draw_field(field, scene.closest, scene.surface, scene.origin, scene.direction, scene.near, scene.far,
                      options);
  };
  const FieldPixels all = draw();
  ASSERT_GT(all.opacity.gt(0.99f).sum().item<int>(), 30);
  for (const int64_t step : {2, 3, 4}) {
    options.first_pass = step;
    const FieldPixels few = draw();
    const Tensor error = torch::cat({few.colour - all.colour, (few.opacity - all.opacity).unsqueeze(1),
                                     ((few.depth - all.depth) * (all.opacity > 0.5)).unsqueeze(1)},
                                    1)
                             .abs();
    EXPECT_LT(error.mean().item<float>(), 2e-4f) << step;
    EXPECT_LT(error.max().item<float>(), 0.02f) << step;  // of a ray that only touches the outline
  }
}

// All samples of such a ray are evaluated: its cells are too long to find empty space by a few of them.
TEST(DrawField, FewSamplesAreAllEvaluated) {
  const Scene scene(300, 64);
  RadianceField field = solid_field();
  FieldImageOptions options;
  for (const int64_t samples : {1, 2, 15}) {
    options.samples = samples;
    const auto draw = [&](int64_t first_pass) {
      options.first_pass = first_pass;
      return draw_field(field, scene.closest, scene.surface, scene.origin, scene.direction, scene.near, scene.far,
                        options);
    };
    const FieldPixels few = draw(4), all = draw(1);
    EXPECT_GT(all.opacity.max().item<float>(), 0.9f) << samples;
    EXPECT_TRUE(torch::equal(few.opacity, all.opacity)) << samples;
  }
}

// Farther from the mesh than the shell there is nothing, whatever the network says.
TEST(RenderField, NothingOutsideTheShell) {
  const Scene scene(40, 64);
  RadianceField field{RadianceFieldConfig()};
  const Tensor near = torch::full({40}, 0.5), far = torch::full({40}, 1.3);  // ends 15 cm before the sphere
  const RaySamples samples = sample_cells(near, far, 16);
  const RenderedRays seen = render_field(field, scene.closest, scene.surface, scene.origin, scene.direction, samples);
  EXPECT_EQ(seen.opacity.abs().max().item<float>(), 0.0f);
  const FieldPixels image = draw_field(field, scene.closest, scene.surface, scene.origin, scene.direction, near, far);
  EXPECT_EQ(image.colour.abs().max().item<float>(), 0.0f);
}

TEST(RadianceField, RejectsWhatDoesNotFit) {
  RadianceFieldConfig config;
  config.layers = 0;
  config.t_mi = 0.0;
  EXPECT_THAT(message_of<UsageError>([&] { RadianceField field(config); }),
              testing::AllOf(testing::HasSubstr("layers must be"), testing::HasSubstr("t_mi and t_ma")));
  const Scene scene(4, 64);
  RadianceField field{RadianceFieldConfig()};
  EXPECT_THAT(message_of<UsageError>([&] {
                field->forward(torch::zeros({2, 3}), torch::zeros({2}), torch::zeros({2, 3}));
              }),
              testing::HasSubstr("values must be"));
  EXPECT_THAT(message_of<UsageError>([&] {
                draw_field(field, scene.closest, scene.surface, scene.origin, scene.direction, scene.near * NAN,
                           scene.far);
              }),
              testing::HasSubstr("not finite"));
  EXPECT_THAT(message_of<UsageError>([&] {
                draw_field(field, scene.closest, {scene.surface.vertices.to(torch::kFloat64), scene.surface.values},
                           scene.origin, scene.direction, scene.near, scene.far);
              }),
              testing::HasSubstr("float32 on the CPU"));
}

}  // namespace
}  // namespace doppel::radiance_field_test
