#include "doppel/layers/closest_point/closest_point.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "geometry/meshes.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::closest_point_test {
namespace {

using Eigen::Vector3d;
using support::message_of;
using namespace test;
using torch::Tensor;

const TriangleMesh& actor() {
  static const TriangleMesh mesh = make_test_character().mesh;
  return mesh;
}
Tensor vertices_of(const TriangleMesh& mesh) {
  Tensor result = torch::empty({mesh.num_vertices(), 3}, torch::kFloat64);
  for (int i = 0; i < mesh.num_vertices(); ++i)
    for (int k = 0; k < 3; ++k) result[i][k] = mesh.vertices[i][k];
  return result;
}
/// Random points in and around the actor. @return float64 [B,count,3]
Tensor points_around(const Tensor& vertices, int64_t count, uint64_t seed) {
  const Tensor low = vertices.amin(1, true), high = vertices.amax(1, true);
  const Tensor part = torch::rand({vertices.size(0), count, 3}, at::detail::createCPUGenerator(seed), torch::kFloat64);
  return low - 0.1 + part * (high - low + 0.2);
}
/// The actor, bent differently in each item of the batch. @return float64 [B,N,3]
Tensor bent(int64_t batch) {
  const Tensor rest = vertices_of(actor()), height = rest.select(1, 1);
  std::vector<Tensor> items;
  for (int64_t b = 0; b < batch; ++b) {
    Tensor moved = rest.clone();
    moved.select(1, 0) += 0.1 * static_cast<double>(b) * (3.0 * height).sin();
    moved.select(1, 2) += 0.07 * static_cast<double>(b) * (4.0 * height).cos();
    items.push_back(moved);
  }
  return torch::stack(items);
}

/// How often the surface winds around a point, from the solid angles of its faces: 1 inside, 0 outside.
double winding(const Vector3d& p, const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const auto& [i, j, k] : mesh.faces) {
    const Vector3d a = mesh.vertices[i] - p, b = mesh.vertices[j] - p, c = mesh.vertices[k] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4.0 * M_PI);
}

TEST(ClosestPointReference, AHundredThousandQueriesEqualBruteForce) {
  const ClosestPoint layer(actor());
  const Tensor vertices = vertices_of(actor()).unsqueeze(0).to(torch::kFloat32);
  const Tensor points = points_around(vertices.to(torch::kFloat64), 100000, 1).to(torch::kFloat32);
  const ClosestPoints found = layer->forward(vertices, points);
  TriangleMesh mesh = actor();
  mesh.vertices = positions_of(vertices[0]);
  const std::vector<Vector3d> at = positions_of(points[0]);
  const float* distance = found.distance.data_ptr<float>();
  double worst = 0.0;
  int wrong = 0, inside = 0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double expected = support::distance_to_mesh(at[i], mesh);
    worst = std::max(worst, std::abs(std::abs(distance[i]) - expected));
    if (expected < 1e-9) continue;
    const bool within = winding(at[i], mesh) > 0.5;
    inside += within;
    wrong += (distance[i] < 0) != within;
  }
  EXPECT_LT(worst, 1e-6);
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(inside, 1000);
}

// At the vertices and the middles of the edges a step along the normal leads out, one against it in.
TEST(ClosestPointReference, SignsAtTheEdgesAndVerticesOfATemplate) {
  const ClosestPoint layer(actor());
  const ClosedSurface surface = layer->surface();
  const Tensor vertices = vertices_of(actor()).unsqueeze(0);
  for (std::size_t f = 0; f < actor().faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Vector3d corner = actor().vertices[actor().faces[f][k]];
      const Vector3d middle = 0.5 * (corner + actor().vertices[actor().faces[f][(k + 1) % 3]]);
      for (const Vector3d& position : {corner, middle}) {
        const Vector3d out = surface.closest(position).outward;
        for (double step : {1e-5, 1e-4}) {
          EXPECT_GT(surface.closest(position + step * out).distance, 0.1 * step);
          EXPECT_LT(surface.closest(position - step * out).distance, -0.1 * step);
        }
      }
    }
}

TEST(ClosestPointAgrees, SearchAndReference) {
  const ClosestPoint layer(actor());
  const Tensor vertices = bent(3), points = points_around(vertices, 400, 2);
  const ClosestPoints expected = layer->forward(vertices, points);
  const ClosestPoints found = layer->forward(vertices.to(torch::kFloat32), points.to(torch::kFloat32));
  EXPECT_TRUE(is_near(found.distance, expected.distance, 1e-6));
  const auto position = [&](const ClosestPoints& at) {
    const Tensor w = at.weights.to(torch::kFloat64);
    return layer->interpolate({at.distance, w, at.face}, vertices);
  };
  EXPECT_TRUE(is_near(position(found), position(expected), 1e-5));
  EXPECT_GT((found.face == expected.face).to(torch::kFloat32).mean().item<float>(), 0.7);  // edges have two faces
  EXPECT_GE(found.weights.min().item<float>(), 0.0f);
  EXPECT_TRUE(is_near(found.weights.sum(-1), torch::ones({3, 400}), 1e-6));
}

TEST(ClosestPointAgrees, InAReferenceScope) {
  const ClosestPoint layer(actor());
  const Tensor vertices = bent(1).to(torch::kFloat32), points = points_around(bent(1), 100, 3).to(torch::kFloat32);
  const ClosestPoints fast = layer->forward(vertices, points);
  const ReferenceScope scope;
  EXPECT_TRUE(is_near(layer->forward(vertices, points).distance, fast.distance, 2e-6));
}

// Few points, so that none stands where two positions of the surface are equally close.
TEST(ClosestPointGradient, CentralDifferences) {
  const TriangleMesh sphere = support::make_sphere(1, 0.6);
  const ClosestPoint layer(sphere);
  const Tensor vertices = vertices_of(sphere).unsqueeze(0) + 0.05 * random_numbers({2, sphere.num_vertices(), 3}, 4);
  const Tensor points = 0.8 * random_numbers({2, 30, 3}, 5);
  const Tensor values = random_numbers({2, sphere.num_vertices(), 4}, 6);
  const ClosestPoints at = layer->forward(vertices, points);
  const Tensor corners = (at.weights > 0).sum(-1);
  for (int count : {1, 2, 3}) EXPECT_GT((corners == count).sum().item<int64_t>(), 2) << "points on " << count;
  EXPECT_TRUE(gradients_match([&](const std::vector<Tensor>& in) { return layer->forward(in[0], in[1]).distance; },
                              {{"vertices", vertices}, {"points", points}}));
  EXPECT_TRUE(gradients_match(
      [&](const std::vector<Tensor>& in) {
        const ClosestPoints found = layer->forward(in[0], in[1]);
        return layer->interpolate(found, in[2]);
      },
      {{"vertices", vertices}, {"points", points}, {"values", values}}));
}

TEST(ClosestPointGradient, OfTheSearchIsThatOfTheReference) {
  const TriangleMesh sphere = support::make_sphere(1, 0.6);
  const ClosestPoint layer(sphere);
  const Tensor vertices = vertices_of(sphere).unsqueeze(0) + 0.05 * random_numbers({2, sphere.num_vertices(), 3}, 4);
  const Tensor points = 0.8 * random_numbers({2, 200, 3}, 5), probe = random_numbers({2, 200, 4}, 7);
  const Tensor values = random_numbers({2, sphere.num_vertices(), 3}, 8);
  const auto gradients = [&](torch::ScalarType type) {
    Tensor v = vertices.clone().to(type).requires_grad_(), p = points.clone().to(type).requires_grad_();
    const ClosestPoints at = layer->forward(v, p);
    // Not the weights themselves: on an edge their order is that of whichever of its faces was found.
    const Tensor there = layer->interpolate(at, values.to(type));
    (torch::cat({at.distance.unsqueeze(-1), there}, -1) * probe.to(type)).sum().backward();
    return std::vector<Tensor>{v.grad(), p.grad()};
  };
  const std::vector<Tensor> expected = gradients(torch::kFloat64), found = gradients(torch::kFloat32);
  EXPECT_TRUE(is_near(found[0], expected[0], 1e-4, 1e-4));
  EXPECT_TRUE(is_near(found[1], expected[1], 1e-4, 1e-4));
}

TEST(ClosestPointAgrees, AnyNumberOfThreads) {
  const ClosestPoint layer(actor());
  const int before = at::get_num_threads();
  std::vector<std::vector<Tensor>> results;
  for (int threads : {1, 3}) {
    at::set_num_threads(threads);
    Tensor vertices = bent(2).to(torch::kFloat32).requires_grad_();
    const ClosestPoints at = layer->forward(vertices, points_around(bent(2), 2000, 8).to(torch::kFloat32));
    (at.distance.sum() + at.weights.select(-1, 1).sum()).backward();
    results.push_back({at.distance, at.weights, at.face, vertices.grad()});
  }
  at::set_num_threads(before);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_TRUE(torch::equal(results[0][i], results[1][i])) << i;
}

TEST(ClosestPointReference, DistanceAsAPartOfTheShell) {
  const Tensor distance = torch::tensor({-0.08, -0.01, 0.0, 0.01, 0.2}, torch::kFloat64);
  const Tensor expected = torch::tensor({-1.0, -0.5, 0.0, 0.25, 1.0}, torch::kFloat64);
  EXPECT_TRUE(is_near(normalised_distance(distance, 0.02, 0.04), expected, 1e-12));
}

TEST(ClosestPointRejects, OpenMeshesAndNumbersThatAreNone) {
  TriangleMesh open = actor();
  open.faces.pop_back();
  EXPECT_THAT(message_of<Error>([&] { ClosestPoint layer(open); }),
              testing::HasSubstr("3 edges belong to one face only"));
  const ClosestPoint layer(actor());
  const Tensor vertices = bent(1).to(torch::kFloat32), points = torch::zeros({1, 2, 3});
  const auto complaint = [&](const Tensor& v, const Tensor& p) {
    return message_of<UsageError>([&] { layer->forward(v, p); });
  };
  EXPECT_THAT(complaint(vertices, torch::full({1, 2, 3}, NAN)), testing::HasSubstr("points has numbers"));
  EXPECT_THAT(complaint(vertices * INFINITY, points), testing::HasSubstr("vertices has numbers"));
  EXPECT_THAT(complaint(vertices, points[0]), testing::HasSubstr("[B,P,3]"));
  EXPECT_THAT(complaint(vertices.narrow(1, 0, 5), points), testing::HasSubstr("[B,N,3]"));
  EXPECT_EQ(layer->forward(vertices, torch::empty({1, 0, 3})).distance.numel(), 0);
}

}  // namespace
}  // namespace doppel::closest_point_test
