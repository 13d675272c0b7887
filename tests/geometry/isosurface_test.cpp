// Surfaces of distance fields on grids whose planes are not evenly spaced.
#include "doppel/geometry/isosurface.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "doppel/geometry/topology.h"

namespace doppel::isosurface_test {
namespace {

using Eigen::Vector3d;

TEST(GridLines, CoverTheBoxWithCellsOfTheGivenSize) {
  GridLines lines = regular_lines({-1, -1, -1}, {1, 1, 1}, 0.1);
  refine_lines(lines, {0.31, -0.5, -0.02}, {0.52, 0.5, 0.02}, 0.02);
  for (const GridLine& line : lines) {
    EXPECT_LE(line.planes.front(), -1.0);
    EXPECT_GE(line.planes.back(), 1.0);
    ASSERT_EQ(line.cells.size(), line.planes.size());
    for (std::size_t i = 0; i + 1 < line.planes.size(); ++i) {
      EXPECT_GT(line.cells[i], 0.0);
      EXPECT_LE(line.cells[i], 0.1 + 1e-12);
      EXPECT_NEAR(line.planes[i + 1] - line.planes[i], line.cells[i], 1e-15);
    }
  }
  const GridLine& x = lines[0];
  for (std::size_t i = 0; i + 1 < x.planes.size(); ++i)
    if (x.planes[i] >= 0.31 && x.planes[i + 1] <= 0.52) {
      EXPECT_LE(x.cells[i], 0.02 + 1e-12);
    }
}

/// Two bars side by side, 4 mm apart, that a third one joins at their ends.
double fork(const Vector3d& p) {
  const double joint = round_cone(p, {0, -0.007, 0}, {0, 0.007, 0}, 0.005, 0.005);
  const double prongs = std::min(round_cone(p, {0, -0.007, 0}, {0.06, -0.007, 0}, 0.005, 0.005),
                                 round_cone(p, {0, 0.007, 0}, {0.06, 0.007, 0}, 0.005, 0.005));
  return std::min(joint, prongs);
}

/// How far the middle of an edge lies from the surface at most.
double largest_gap(const TriangleMesh& mesh) {
  double largest = 0.0;
  const MeshTopology topology(mesh);
  for (const auto& [a, b] : topology.edges())
    largest = std::max(largest, std::abs(fork(0.5 * (mesh.vertices[static_cast<std::size_t>(a)] +
                                                     mesh.vertices[static_cast<std::size_t>(b)]))));
  return largest;
}

TEST(MeshField, TellsProngsApartWhereThePlanesAreFine) {
  constexpr double kHalfGap = 0.002, kFine = 0.0015;
  const Vector3d low(-0.03, -0.03, -0.03), high(0.09, 0.03, 0.03);
  GridLines lines = regular_lines(low, high, 6 * kFine);
  refine_lines(lines, {-0.01, -0.015, -0.01}, {0.07, 0.015, 0.01}, kFine);
  EXPECT_LT(largest_gap(mesh_field(fork, lines)), 0.5 * kHalfGap);
  EXPECT_GT(largest_gap(mesh_field(fork, low, high, 6 * kFine)), 0.9 * kHalfGap) << "edges bridge the gap";
}

}  // namespace
}  // namespace doppel::isosurface_test
