#include "doppel/rigging/scan/voxel_solid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "doppel/core/error.h"
#include "doppel/rigging/scan/winding_number.h"
#include "geometry/meshes.h"
#include "rigging/scan/figures.h"
#include "support/message_of.h"

namespace doppel::voxel_solid_test {
namespace {

using Eigen::Vector3d;
using support::make_box;
using support::make_sphere;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

VoxelSolidOptions cells_of(double size) {
  VoxelSolidOptions options;
  options.cell = size;
  return options;
}

TEST(WindingNumber, IsOneInsideAndZeroOutsideOfASphere) {
  const TriangleMesh sphere = make_sphere(4);
  const WindingNumber winding(sphere);
  for (const double r : {0.0, 0.3, 0.7, 0.9, 0.98}) {
    const Vector3d point = r * Vector3d(1, 2, -1).normalized();
    EXPECT_NEAR(winding.at(point), 1.0, 0.03) << r;
  }
  for (const double r : {1.02, 1.2, 2.0, 10.0}) EXPECT_NEAR(winding.at(r * Vector3d(1, 2, -1).normalized()), 0.0, 0.03);
}

TEST(WindingNumber, OfAHemisphereIsItsSolidAngle) {
  TriangleMesh half = make_sphere(4);
  std::erase_if(half.faces, [&](const Triangle& f) {
    return half.vertices[f[0]].y() + half.vertices[f[1]].y() + half.vertices[f[2]].y() < 0.0;
  });
  EXPECT_NEAR(WindingNumber(half).at(Vector3d::Zero()), 0.5, 0.02);
}

TEST(VoxelSolid, DepthOfACubeIsTheDistanceToItsSides) {
  const TriangleMesh cube = make_box({-0.5, 0.0, -0.5}, {0.5, 1.0, 0.5});
  const VoxelSolid solid(cube, cells_of(0.04));
  EXPECT_NEAR(solid.volume(), 1.0, 0.08);
  for (const Vector3d& point : {Vector3d(0, 0.5, 0), Vector3d(0.2, 0.4, -0.1), Vector3d(-0.4, 0.1, 0.3),
                                Vector3d(0.0, 0.9, 0.0), Vector3d(0.7, 0.5, 0.0)}) {
    const Vector3d beyond = (point - Vector3d(0, 0.5, 0)).cwiseAbs() - Vector3d::Constant(0.5);
    const double ground_truth = -beyond.maxCoeff();
    EXPECT_NEAR(solid.depth(point), ground_truth, 0.03) << point.transpose();
    EXPECT_EQ(solid.inside(point), ground_truth > 0.0);
  }
  EXPECT_LT(solid.depth({5.0, 0.5, 0.0}), -4.4);
}

TEST(VoxelSolid, ASphereWithHolesKeepsItsInside) {
  TriangleMesh sphere = make_sphere(4);
  const double before = static_cast<double>(sphere.faces.size());
  std::erase_if(sphere.faces, [&](const Triangle& f) {
    const Vector3d& p = sphere.vertices[f[0]];
    return (p - Vector3d::UnitX()).norm() < 0.3 || (p - Vector3d::UnitZ()).norm() < 0.35;
  });
  ASSERT_LT(static_cast<double>(sphere.faces.size()), 0.96 * before);
  const VoxelSolid solid(sphere, cells_of(0.05));
  EXPECT_NEAR(solid.volume(), 4.0 / 3.0 * std::numbers::pi, 0.15);
  EXPECT_NEAR(solid.depth(Vector3d::Zero()), 1.0, 0.08);
  EXPECT_FALSE(solid.inside({1.3, 0, 0}));
}

TEST(VoxelSolid, OverlappingPartsMakeOneSolidAndInnerSurfacesDoNotCount) {
  TriangleMesh mesh = make_sphere(4);
  support::append(mesh, make_sphere(4, 0.5));
  const VoxelSolid solid(mesh, cells_of(0.05));
  // The inner sphere is at 0.5: the depth there is still that of the outer one.
  EXPECT_NEAR(solid.depth({0.5, 0, 0}), 0.5, 0.06);
  EXPECT_NEAR(solid.depth(Vector3d::Zero()), 1.0, 0.06);
}

TEST(VoxelSolid, SurfacesWoundInwardsAreSolidToo) {
  TriangleMesh mesh = make_sphere(4);
  for (Triangle& face : mesh.faces) std::swap(face[1], face[2]);
  EXPECT_NEAR(VoxelSolid(mesh, cells_of(0.05)).volume(), 4.0 / 3.0 * std::numbers::pi, 0.15);
}

TEST(VoxelSolid, HalfTheSurfaceWoundWrongIsMendedByTheFlood) {
  TriangleMesh mesh = make_sphere(4);
  for (Triangle& face : mesh.faces)
    if (mesh.vertices[face[0]].y() < 0.0) std::swap(face[1], face[2]);
  EXPECT_TRUE(VoxelSolid(mesh, cells_of(0.05)).inside({0, -0.5, 0}));
}

TEST(VoxelSolid, ANarrowGapDoesNotFill) {
  TriangleMesh mesh = make_box({-1.0, 0, 0}, {-0.05, 1, 1});
  support::append(mesh, make_box({0.05, 0, 0}, {1.0, 1, 1}));
  const VoxelSolid solid(mesh, cells_of(0.04));
  EXPECT_FALSE(solid.inside({0.0, 0.5, 0.5}));
  EXPECT_TRUE(solid.inside({0.15, 0.5, 0.5}));
  EXPECT_TRUE(solid.inside({-0.15, 0.5, 0.5}));
}

TEST(VoxelSolid, CellsAndNeighboursAreNumberedXFirst) {
  const VoxelSolid solid(make_box({0, 0, 0}, {1, 1, 1}), cells_of(0.1));
  const int cell = solid.index({5, 4, 6});
  const auto around = solid.neighbours(cell);
  for (int k = 0; k < 6; ++k) {
    const Vector3d step = (k % 2 == 0 ? -0.1 : 0.1) * Vector3d::Unit(k / 2);
    EXPECT_LT((solid.centre(around[k]) - solid.centre(cell) - step).norm(), 1e-12);
  }
  EXPECT_EQ(solid.neighbours(0)[0], -1);
}

TEST(VoxelSolid, RefusesAGridThatIsTooLargeWithACellThatFits) {
  EXPECT_THAT(message_of<UsageError>([] { VoxelSolid(make_sphere(2, 900.0), cells_of(0.01)); }),
              AllOf(HasSubstr("1.8e+03 x 1.8e+03"), HasSubstr("check the unit"), HasSubstr("use cells of")));
}

}  // namespace
}  // namespace doppel::voxel_solid_test
