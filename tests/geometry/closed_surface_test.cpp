#include "doppel/geometry/closed_surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "doppel/core/error.h"
#include "geometry/meshes.h"
#include "support/message_of.h"

namespace doppel::closed_surface_test {
namespace {

using Eigen::Vector3d;
using support::message_of;

/// A cube of side 2 around the origin; its diagonals make faces of 45 and of 90 degrees at the corners.
TriangleMesh make_cube() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.vertices.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

double distance_from_cube(const Vector3d& p) {
  const Vector3d beyond = p.cwiseAbs() - Vector3d::Ones();
  return beyond.cwiseMax(Vector3d::Zero()).norm() + std::min(0.0, beyond.maxCoeff());
}

TEST(ClosedSurface, SignedDistanceFromACube) {
  const TriangleMesh cube = make_cube();
  const ClosedSurface surface(cube.vertices, cube.faces);
  std::mt19937 generator(3);
  const auto number = [&] { return 4.0 * (static_cast<double>(generator()) / 4294967295.0) - 2.0; };
  for (int i = 0; i < 5000; ++i) {
    const double x = number(), y = number();
    const Vector3d p(x, y, number());
    EXPECT_NEAR(surface.closest(p).distance, distance_from_cube(p), 1e-12);
  }
}

// Points whose closest point is an edge or a vertex exactly, from every direction that has it so.
TEST(ClosedSurface, IsOutsideBeyondEveryEdgeAndVertex) {
  const TriangleMesh cube = make_cube();
  const ClosedSurface surface(cube.vertices, cube.faces);
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        const Vector3d corner(x, y, z);
        for (double sx : {1e-6, 0.5, 3.0})
          for (double sy : {1e-6, 0.5, 3.0}) {
            const Vector3d out(x * sx, y * sy, z * 0.7);
            if (corner.squaredNorm() == 0) continue;
            const auto hit = surface.closest(corner + out);
            EXPECT_NEAR(hit.distance, out.norm(), 1e-12) << corner.transpose() << ", " << out.transpose();
            EXPECT_LT((hit.outward - out.normalized()).norm(), 1e-6);
          }
        EXPECT_NEAR(surface.closest(0.9 * corner).distance, -0.1 - 0.9 * (corner.squaredNorm() == 0), 1e-12);
      }
}

// A dent as deep as it is steep: the plain sum of face normals there, one of many thin faces and one of few wide ones,
// would get some of these wrong.
TEST(ClosedSurface, SignsOfAStarOfUnevenFaces) {
  TriangleMesh star = support::make_sphere(3);
  for (std::size_t i = 0; i < star.vertices.size(); i += 3) star.vertices[i] *= 0.45;
  const ClosedSurface surface(star.vertices, star.faces);
  // A radial surface: a point is inside exactly if it is nearer to the centre than the face in its direction.
  std::mt19937 generator(7);
  const auto number = [&] { return 2.4 * (static_cast<double>(generator()) / 4294967295.0) - 1.2; };
  int checked = 0, inside_count = 0, at_corners = 0;
  for (int i = 0; i < 4000; ++i) {
    const double x = number(), y = number();
    const Vector3d p(x, y, number());
    for (const auto& [a, b, c] : star.faces) {
      Eigen::Matrix3d corners;
      corners << star.vertices[a], star.vertices[b], star.vertices[c];
      const Vector3d weights = corners.inverse() * p;
      if (weights.minCoeff() < 0) continue;
      const auto hit = surface.closest(p);
      EXPECT_EQ(hit.distance < 0, weights.sum() < 1) << p.transpose();
      at_corners += *std::max_element(hit.weights.begin(), hit.weights.end()) == 1.0;
      inside_count += weights.sum() < 1;
      ++checked;
      break;
    }
  }
  EXPECT_GT(checked, 3900);
  EXPECT_GT(inside_count, 100);
  EXPECT_GT(at_corners, 300);
}

TEST(ClosedSurface, GrowsOutwardsByOne) {
  const TriangleMesh sphere = support::make_sphere(2, 0.7);
  const ClosedSurface surface(sphere.vertices, sphere.faces);
  std::mt19937 generator(11);
  const auto number = [&] { return 2.0 * (static_cast<double>(generator()) / 4294967295.0) - 1.0; };
  for (int i = 0; i < 500; ++i) {
    const double x = number(), y = number();
    const Vector3d p(x, y, number());
    const auto hit = surface.closest(p);
    if (std::abs(hit.distance) > 0.5) continue;  // near the centre many points are the closest
    EXPECT_NEAR(surface.closest(p + 1e-6 * hit.outward).distance - hit.distance, 1e-6, 1e-9);
  }
}

TEST(ClosedSurface, OnTheSurfaceOutwardIsTheNormal) {
  const TriangleMesh cube = make_cube();
  const ClosedSurface surface(cube.vertices, cube.faces);
  EXPECT_LT((surface.closest({0.25, 1.0, 0.5}).outward - Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT((surface.closest({1, 1, 1}).outward - Vector3d::Ones().normalized()).norm(), 1e-12);
  EXPECT_EQ(surface.closest({1, 1, 1}).distance, 0.0);
}

TEST(ClosedSurface, MovesWithItsVertices) {
  TriangleMesh cube = make_cube();
  ClosedSurface surface(cube.vertices, cube.faces);
  for (Vector3d& v : cube.vertices) v = 2.0 * v + Vector3d(5, 0, 0);
  surface.move(cube.vertices);
  EXPECT_NEAR(surface.closest({5, 0, 0.5}).distance, -1.5, 1e-12);
  EXPECT_NEAR(surface.closest({0, 0, 0}).distance, 3.0, 1e-12);
}

TEST(FacesAcrossEdges, NamesTheFacesBeyond) {
  const TriangleMesh cube = make_cube();
  const std::vector<Triangle> across = faces_across_edges(cube.faces);
  for (int f = 0; f < cube.num_faces(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Triangle& other = cube.faces[across[f][k]];
      EXPECT_NE(across[f][k], f);
      for (int end : {k, (k + 1) % 3})
        EXPECT_NE(std::find(other.begin(), other.end(), cube.faces[f][end]), other.end());
    }
}

TEST(FacesAcrossEdges, NameWhatIsOpenOrTangled) {
  TriangleMesh open = make_cube();
  open.faces.erase(open.faces.begin());
  EXPECT_THAT(message_of<Error>([&] { ClosedSurface(open.vertices, open.faces); }),
              testing::AllOf(testing::HasSubstr("3 edges belong to one face only"), testing::HasSubstr("0-1, 1-2, 2-0"),
                             testing::HasSubstr("fill the holes")));
  TriangleMesh flipped = make_cube();
  std::swap(flipped.faces[4][0], flipped.faces[4][1]);
  EXPECT_THAT(message_of<Error>([&] { faces_across_edges(flipped.faces); }),
              testing::HasSubstr("two wound in opposite senses"));
  EXPECT_THAT(message_of<Error>([&] { faces_across_edges(support::make_sheet(4, 4).faces); }),
              testing::AllOf(testing::HasSubstr("16 edges"), testing::HasSubstr(", ...")));
}

}  // namespace
}  // namespace doppel::closed_surface_test
