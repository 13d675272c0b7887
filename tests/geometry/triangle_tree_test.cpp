#include "doppel/geometry/triangle_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "doppel/core/error.h"
#include "geometry/meshes.h"
#include "support/message_of.h"

namespace doppel::triangle_tree_test {
namespace {

using Eigen::Vector3d;
using support::distance_to_triangle;
using support::message_of;
using Corners = std::array<Vector3d, 3>;

/// The same points on every machine.
class RandomPoints {
 public:
  explicit RandomPoints(unsigned seed) : generator_(seed) {}
  /// In a cube of the half side `reach` around the origin.
  Vector3d next(double reach) {
    const auto number = [&] { return reach * (2.0 * (static_cast<double>(generator_()) / 4294967295.0) - 1.0); };
    const double x = number(), y = number();
    return {x, y, number()};
  }

 private:
  std::mt19937 generator_;
};

TEST(ClosestOnTriangle, FaceEdgesCorners) {
  const Corners t{Vector3d(0, 0, 0), Vector3d(4, 0, 0), Vector3d(0, 3, 0)};
  const auto distance = [&](double x, double y, double z) {
    return std::sqrt(closest_on_triangle({x, y, z}, t).squared_distance);
  };
  EXPECT_DOUBLE_EQ(distance(1, 1, -2), 2.0);
  EXPECT_DOUBLE_EQ(distance(2, -3, 4), 5.0);                 // edge along x
  EXPECT_DOUBLE_EQ(distance(-3, -4, 12), 13.0);              // corner
  EXPECT_NEAR(distance(2 + 0.6, 1.5 + 0.8, 0), 1.0, 1e-12);  // long edge
  EXPECT_DOUBLE_EQ(distance(0.5, 0.5, 0), 0.0);
  EXPECT_THAT(closest_on_triangle({-3, -4, 12}, t).weights, testing::ElementsAre(1, 0, 0));
  EXPECT_THAT(closest_on_triangle({2, -3, 4}, t).weights, testing::ElementsAre(0.5, 0.5, 0));
}

TEST(ClosestOnTriangle, IsWhereItsWeightsSay) {
  RandomPoints random(4);
  for (int i = 0; i < 2000; ++i) {
    const Corners t{random.next(1), random.next(1), random.next(1)};
    const Vector3d p = random.next(2);
    const TrianglePoint found = closest_on_triangle(p, t);
    const auto& w = found.weights;
    EXPECT_NEAR((w[0] * t[0] + w[1] * t[1] + w[2] * t[2] - p).norm(), std::sqrt(found.squared_distance), 1e-9);
    EXPECT_NEAR(distance_to_triangle(p, t), std::sqrt(found.squared_distance), 1e-9);
    EXPECT_TRUE(w[0] >= 0 && w[1] >= 0 && w[2] >= 0);
    EXPECT_NEAR(w[0] + w[1] + w[2], 1.0, 1e-12);
  }
}

TEST(ClosestOnTriangle, LinesAndPoints) {
  const Corners line{Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(2, 0, 0)};
  EXPECT_DOUBLE_EQ(closest_on_triangle({1.5, 2, 0}, line).squared_distance, 4.0);
  const Corners point{Vector3d(1, 1, 1), Vector3d(1, 1, 1), Vector3d(1, 1, 1)};
  EXPECT_DOUBLE_EQ(closest_on_triangle({1, 1, 4}, point).squared_distance, 9.0);
}

/// A soup of triangles, all over each other.
TriangleMesh random_soup(int vertices, int faces) {
  RandomPoints random(9);
  std::mt19937 generator(2);
  TriangleMesh mesh;
  for (int i = 0; i < vertices; ++i) mesh.vertices.push_back(random.next(1));
  for (int i = 0; i < faces; ++i) {
    const auto pick = [&] { return static_cast<int>(generator() % static_cast<unsigned>(vertices)); };
    const int a = pick(), b = pick();
    mesh.faces.push_back({a, b, pick()});
  }
  return mesh;
}

TriangleTree::Hit among_all(const Vector3d& point, const TriangleMesh& mesh) {
  TriangleTree::Hit best;
  for (int f = 0; f < mesh.num_faces(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    const TrianglePoint found = closest_on_triangle(point, {mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
    if (found.squared_distance >= best.squared_distance) continue;
    static_cast<TrianglePoint&>(best) = found;
    best.face = f;
  }
  return best;
}

void expect_same(const TriangleTree::Hit& found, const TriangleTree::Hit& expected) {
  EXPECT_EQ(found.face, expected.face);
  EXPECT_EQ(found.squared_distance, expected.squared_distance);
  EXPECT_EQ(found.weights, expected.weights);
}

TEST(TriangleTree, EqualsAllTriangles) {
  for (const TriangleMesh& mesh : {random_soup(200, 700), support::make_sphere(3), support::make_sheet(1, 1)}) {
    const TriangleTree tree(mesh.vertices, mesh.faces);
    RandomPoints random(1);
    for (int i = 0; i < 500; ++i) {
      const Vector3d point = random.next(2);
      expect_same(tree.closest(point), among_all(point, mesh));
    }
    // Vertices belong to many faces: the lowest is found.
    for (const Vector3d& vertex : mesh.vertices) expect_same(tree.closest(vertex), among_all(vertex, mesh));
  }
}

TEST(TriangleTree, AHintChangesNothing) {
  const TriangleMesh mesh = random_soup(100, 300);
  const TriangleTree tree(mesh.vertices, mesh.faces);
  RandomPoints random(5);
  for (int face = 0; face < mesh.num_faces(); ++face) {
    const Vector3d point = random.next(1);
    expect_same(tree.closest(point, face), tree.closest(point));
  }
}

TEST(TriangleTree, FollowsVerticesThatMove) {
  TriangleMesh mesh = support::make_sphere(3);
  TriangleTree tree(mesh.vertices, mesh.faces);
  for (Vector3d& v : mesh.vertices) v = Vector3d(3.0 * v.x() + v.y() * v.y(), v.z() - 5.0, std::sin(4.0 * v.y()));
  tree.refit(mesh.vertices);
  RandomPoints random(8);
  for (int i = 0; i < 500; ++i) {
    const Vector3d point = random.next(6);
    expect_same(tree.closest(point), among_all(point, mesh));
  }
}

TEST(TriangleTree, RejectsWhatIsNoMesh) {
  const std::vector<Vector3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto complaint = [&](const std::vector<Triangle>& faces) {
    return message_of<UsageError>([&] { TriangleTree(corners, faces); });
  };
  EXPECT_THAT(complaint({}), testing::HasSubstr("at least one face"));
  EXPECT_THAT(complaint({{0, 1, 3}}), testing::HasSubstr("names vertex 3, but there are 3"));
  TriangleTree tree(corners, {{0, 1, 2}});
  EXPECT_THAT(message_of<UsageError>([&] { tree.refit({{0, 0, 0}}); }), testing::HasSubstr("built for 3 vertices"));
  std::vector<Vector3d> broken = corners;
  broken[1].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<UsageError>([&] { tree.refit(broken); }), testing::HasSubstr("vertex 1 is not finite"));
  EXPECT_THAT(message_of<UsageError>([&] { TriangleTree(broken, {{0, 1, 2}}); }), testing::HasSubstr("not finite"));
}

}  // namespace
}  // namespace doppel::triangle_tree_test
