#include "doppel/track/refine/surface_offset.h"

#include <gtest/gtest.h>

#include "support/test_character.h"

namespace doppel::surface_offset_test {
namespace {

using Eigen::Vector3d;

class SurfaceOffsetTest : public ::testing::Test {
 protected:
  /// Says along all three axes that a vertex is off by `shift`.
  static void measure(SurfaceOffset& offset, int vertex, const Vector3d& shift, double weight) {
    for (int k = 0; k < 3; ++k) offset.add(vertex, Vector3d::Unit(k), -shift[k], weight);
  }
  const TriangleMesh mesh_ = make_test_character(3).mesh;
  const MeshTopology topology_{mesh_};
  const Vector3d shift_{0.01, -0.02, 0.03};
};

TEST_F(SurfaceOffsetTest, AVertexAloneTakesTheWeightedMean) {
  SurfaceOffset offset(mesh_);
  measure(offset, 5, shift_, 3.0);
  measure(offset, 5, -shift_, 1.0);
  const auto found = offset.solve(0.0, 1.0);
  // (3 - 1) / (3 + 1 + stay) of the shift
  EXPECT_LT((found[5] - 2.0 / 5.0 * shift_).norm(), 1e-12);
  EXPECT_LT(found[6].norm(), 1e-12);
}

TEST_F(SurfaceOffsetTest, OnlyTheMeasuredDirectionMoves) {
  SurfaceOffset offset(mesh_);
  const Vector3d normal = Vector3d(1, 2, -1).normalized();
  offset.add(4, normal, -0.05, 1e6);
  EXPECT_LT((offset.solve(0.0, 1.0)[4] - 0.05 * normal).norm(), 1e-6);
}

TEST_F(SurfaceOffsetTest, VerticesWithoutResidualsFollowTheirNeighbours) {
  SurfaceOffset offset(mesh_);
  for (int vertex = 0; vertex < mesh_.num_vertices(); vertex += 3) measure(offset, vertex, shift_, 1.0);
  for (const Vector3d& found : offset.solve(10.0, 1e-9)) EXPECT_LT((found - shift_).norm(), 1e-6);
}

TEST_F(SurfaceOffsetTest, SmoothnessEvensOutWhatNeighboursDisagreeOn) {
  const auto roughness = [&](double smoothness) {
    SurfaceOffset offset(mesh_);
    for (int vertex = 0; vertex < mesh_.num_vertices(); ++vertex) measure(offset, vertex, (vertex % 2) * shift_, 1.0);
    const auto found = offset.solve(smoothness, 0.0);
    double sum = 0.0;
    for (const auto& [a, b] : topology_.edges()) sum += (found[a] - found[b]).norm();
    return sum;
  };
  EXPECT_LT(roughness(10.0), 0.2 * roughness(0.0));
}

}  // namespace
}  // namespace doppel::surface_offset_test
