#include "doppel/eval/surface_shape.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::surface_shape_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;
using torch::Tensor;

struct Mesh {
  Tensor vertices, faces;
  SurfaceShape shape(const std::vector<int>& labels = {}) const { return {faces, vertices.size(0), labels}; }
};

/// A square of n x n cells, side 1, in the plane z = 0. A vertex inside has six neighbours: those of its row and
/// column, and two along a diagonal.
Mesh square(int n) {
  std::vector<double> vertices;
  std::vector<int> faces;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      for (double v : {static_cast<double>(i) / n, static_cast<double>(j) / n, 0.0}) vertices.push_back(v);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      for (int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  return {torch::tensor(vertices, torch::kFloat64).view({-1, 3}), torch::tensor(faces, torch::kInt32).view({-1, 3})};
}

/// The same cells, n x n, whose last row and column are joined to the first: every vertex is inside. [n*n,3]
Mesh joined_square(int n) {
  std::vector<int> faces;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int right = (i + 1) % n, up = (j + 1) % n;
      const int a = j * n + i, b = j * n + right, c = up * n + i, d = up * n + right;
      for (int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  return {torch::zeros({n * n, 3}, torch::kFloat64), torch::tensor(faces, torch::kInt32).view({-1, 3})};
}

/// A wave along z on a joined square, with p periods along a row and q along a column. [n*n,3]
Tensor wave(int n, double amplitude, int p, int q) {
  Tensor values = torch::zeros({n * n, 3}, torch::kFloat64);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) values[j * n + i][2] = amplitude * std::sin(2.0 * M_PI * (p * i + q * j) / n);
  return values;
}
/// The factor by which the uniform Laplacian multiplies that wave: sines of the two neighbours along a direction add up
/// to 2 cos(step) times the sine between them.
double factor(int n, int p, int q) {
  const double row = 2.0 * M_PI * p / n, column = 2.0 * M_PI * q / n;
  return 1.0 - (std::cos(row) + std::cos(column) + std::cos(row + column)) / 3.0;
}

/// Turns points about an axis of unit length (Rodrigues).
Tensor turned(const Tensor& points, const Tensor& axis, double angle) {
  const Tensor along = (points * axis).sum(1, true) * axis;
  const Tensor across = at::cross(axis.expand_as(points), points, 1);
  return along + std::cos(angle) * (points - along) + std::sin(angle) * across;
}

Tensor z_axis() { return torch::tensor({0.0, 0.0, 1.0}, torch::kFloat64); }

/// Vertices on the unit sphere; poles at +-y.
Mesh sphere(int rings, int segments) {
  std::vector<double> vertices;
  std::vector<int> faces;
  for (int j = 0; j <= rings; ++j)
    for (int i = 0; i < segments; ++i) {
      const double polar = M_PI * j / rings, around = 2 * M_PI * i / segments;
      for (double v : {std::sin(polar) * std::cos(around), std::cos(polar), std::sin(polar) * std::sin(around)})
        vertices.push_back(v);
    }
  for (int j = 0; j < rings; ++j)
    for (int i = 0; i < segments; ++i) {
      const int a = j * segments + i, b = j * segments + (i + 1) % segments, c = a + segments, d = b + segments;
      for (int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  return {torch::tensor(vertices, torch::kFloat64).view({-1, 3}), torch::tensor(faces, torch::kInt32).view({-1, 3})};
}

TEST(NormalErrorReference, ATurnedSphere) {
  // The normal of the sphere at x is x. After a turn by t about u, its angle to x has the cosine cos t + (1 - cos t)
  // (x . u)^2.
  const Mesh ball = sphere(120, 240);
  const Tensor axis = torch::tensor({0.6, 0.0, 0.8}, torch::kFloat64);
  const double turn = 20.0 * M_PI / 180.0;
  ShapeErrors errors(ball.shape());
  errors.add(turned(ball.vertices, axis, turn), ball.vertices);
  const Tensor along = (ball.vertices * axis).sum(1).square();
  const Tensor angle = torch::acos((std::cos(turn) + (1.0 - std::cos(turn)) * along).clamp(-1, 1));
  EXPECT_NEAR(errors.normal_error().value(), angle.mean().item<double>() * 180.0 / M_PI, 0.05);
}

TEST(NormalErrorReference, FramesAreAveragedAndVerticesWithoutAreaAreLeftOut) {
  Mesh plane = square(5);
  plane.vertices = torch::cat({plane.vertices, torch::full({1, 3}, 7.0, torch::kFloat64)});  // in no face
  const Tensor axis = torch::tensor({1.0, 0.0, 0.0}, torch::kFloat64);
  ShapeErrors errors(plane.shape());
  errors.add(turned(plane.vertices, axis, M_PI / 6.0), plane.vertices);
  EXPECT_NEAR(errors.normal_error().value(), 30.0, 1e-9);
  errors.add(turned(plane.vertices, axis, M_PI / 2.0), plane.vertices);
  errors.add(turned(plane.vertices, z_axis(), M_PI / 3.0), plane.vertices);  // in its own plane
  EXPECT_NEAR(errors.normal_error().value(), 40.0, 1e-9);
}

TEST(UniformLaplacianReference, WavesAreItsEigenvectors) {
  const int n = 12;
  const SurfaceShape shape = joined_square(n).shape();
  for (const auto& [p, q] : {std::pair{1, 0}, {2, 1}, {3, 5}, {6, 6}}) {
    const Tensor values = wave(n, 0.3, p, q) + 1.0;
    const Tensor expected = factor(n, p, q) * wave(n, 0.3, p, q);
    EXPECT_LT((shape.laplacian(values) - expected).abs().max().item<double>(), 1e-12) << p << " " << q;
  }
}

TEST(UniformLaplacianReference, AtAnOpenBorderTheMeanIsOverTheNeighboursThere) {
  // The corner (0,0) of the square has three neighbours: right, up and along the diagonal.
  const Mesh plane = square(4);
  const Tensor corner = plane.shape().laplacian(plane.vertices)[0];
  EXPECT_NEAR(corner[0].item<double>(), -2.0 / 3.0 / 4.0, 1e-12);
  EXPECT_NEAR(corner[1].item<double>(), -2.0 / 3.0 / 4.0, 1e-12);
}

TEST(RoughnessReference, WavesHaveAKnownOne) {
  const int n = 12;
  const Mesh mesh = joined_square(n);
  ShapeErrors errors(mesh.shape());
  const Tensor ground_truth = wave(n, 0.004, 1, 2), found = wave(n, 0.003, 4, 1);
  errors.add(found, ground_truth);
  errors.add_displacements(found, ground_truth);
  const double true_roughness = 0.004 * factor(n, 1, 2), roughness = 0.003 * factor(n, 4, 1);
  EXPECT_NEAR(errors.roughness_ratio().value(), roughness / true_roughness, 1e-9);
  // Different waves are orthogonal, so squares add up; the mean square of a sine is one half.
  EXPECT_NEAR(errors.roughness_error().value(), std::sqrt(0.5) * std::hypot(roughness, true_roughness), 1e-9);
  // A second frame that is twice as rough: a root mean square over both.
  errors.add_displacements(2.0 * found, ground_truth);
  EXPECT_NEAR(errors.roughness_ratio().value(), std::sqrt(2.5) * roughness / true_roughness, 1e-9);
}

TEST(RoughnessReference, ASpikeOnOneVertex) {
  // The vertex differs from the mean of its neighbours by the height h, each of its six neighbours by h / 6.
  const int n = 10;
  const Mesh mesh = joined_square(n);
  Tensor spike = torch::zeros_like(mesh.vertices);
  spike[37][2] = 0.05;
  ShapeErrors errors(mesh.shape());
  errors.add(mesh.vertices + spike, mesh.vertices);
  const double expected = 0.05 * std::sqrt((1.0 + 6.0 / 36.0) / (n * n));
  EXPECT_NEAR(errors.roughness_error().value(), expected, 1e-12);
  // A shift of all vertices moves them farther than the spike does, and adds nothing.
  ShapeErrors shifted(mesh.shape());
  shifted.add(mesh.vertices + spike + 0.2, mesh.vertices);
  EXPECT_NEAR(shifted.roughness_error().value(), expected, 1e-12);
}

TEST(RoughnessReference, TurningEverythingChangesNothing) {
  const int n = 8;
  const Mesh mesh = joined_square(n);
  const Tensor ground_truth = wave(n, 0.02, 1, 1), found = wave(n, 0.03, 2, 1);
  const Tensor axis = torch::tensor({0.6, 0.8, 0.0}, torch::kFloat64);
  ShapeErrors still(mesh.shape()), moved(mesh.shape());
  still.add_displacements(found, ground_truth);
  moved.add_displacements(turned(found, axis, 1.1), turned(ground_truth, axis, -0.4));
  EXPECT_NEAR(moved.roughness_ratio().value(), still.roughness_ratio().value(), 1e-12);
}

TEST(RoughnessReference, ThereIsNoRatioToASmoothSurface) {
  const Mesh mesh = joined_square(6);
  ShapeErrors errors(mesh.shape());
  EXPECT_FALSE(errors.roughness_ratio() || errors.roughness_error() || errors.normal_error());
  errors.add_displacements(wave(6, 0.01, 1, 1), wave(6, 1e-7, 1, 1));
  EXPECT_FALSE(errors.roughness_ratio());
  errors.add_displacements(torch::zeros_like(mesh.vertices), wave(6, 0.01, 1, 1));
  EXPECT_TRUE(errors.roughness_ratio());
}

TEST(BorderLengthReference, OpenEdgesAndTheLineBetweenLabels) {
  const Mesh plane = square(4);
  EXPECT_NEAR(plane.shape().border_length(plane.vertices), 4.0, 1e-12);
  // Columns 0 and 1 have one label, 2 to 4 another: a straight line of length 1 between them.
  std::vector<int> labels;
  for (int v = 0; v < 25; ++v) labels.push_back(v % 5 < 2 ? 5 : 9);
  EXPECT_NEAR(plane.shape(labels).border_length(plane.vertices), 5.0, 1e-12);
  // Without open edges only the two lines are left, at columns 1-2 and, where the ends are joined, 5-0.
  const Mesh joined = joined_square(6);
  Tensor grid = torch::zeros({36, 3}, torch::kFloat64);
  std::vector<int> halves;
  for (int v = 0; v < 36; ++v) {
    grid[v][1] = 0.5 * (v / 6);
    halves.push_back(v % 6 < 2 ? 5 : 9);
  }
  // Five cells of a column are 0.5 long, the sixth leads back over 2.5.
  EXPECT_NEAR(joined.shape(halves).border_length(grid), 2.0 * 5.0, 1e-12);
  EXPECT_EQ(joined.shape().border_length(grid), 0.0);
}

TEST(BorderLengthReference, ASpikeAtAHemMakesItLonger) {
  const Mesh plane = square(4);
  Tensor spike = plane.vertices.clone();
  spike[2][1] = -1.0;  // the middle of the lower side
  ShapeErrors errors(plane.shape());
  errors.add(1.5 * plane.vertices, plane.vertices);
  EXPECT_NEAR(errors.border_length_ratio().value(), 1.5, 1e-12);
  errors.add(spike, plane.vertices);
  const double longer = (3.5 + 2.0 * std::hypot(0.25, 1.0)) / 4.0;
  EXPECT_NEAR(errors.border_length_ratio().value(), 0.5 * (1.5 + longer), 1e-12);
  ShapeErrors closed(joined_square(6).shape());
  closed.add(wave(6, 0.1, 1, 1), wave(6, 0.1, 1, 1));
  EXPECT_FALSE(closed.border_length_ratio());
}

TEST(SurfaceShapeRejects, OtherMeshes) {
  const Mesh plane = square(2);
  EXPECT_THAT(message_of<UsageError>([&] { plane.shape({1, 2}); }), HasSubstr("2 labels for 9 vertices"));
  EXPECT_THAT(message_of([&] { SurfaceShape(plane.faces, 4, {}); }), HasSubstr("4 vertices"));
  EXPECT_THAT(message_of<UsageError>([&] { plane.shape().laplacian(torch::zeros({4, 3})); }), HasSubstr("[N,3]"));
}

}  // namespace
}  // namespace doppel::surface_shape_test
