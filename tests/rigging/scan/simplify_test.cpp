#include "doppel/rigging/scan/simplify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "doppel/geometry/triangle_tree.h"
#include "geometry/meshes.h"
#include "rigging/scan/figures.h"
#include "support/message_of.h"

namespace doppel::simplify_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using support::make_sphere;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

TriangleMesh to_faces(const TriangleMesh& mesh, int faces, SimplifyReport* report = nullptr) {
  SimplifyOptions options;
  options.target_faces = faces;
  return simplify(mesh, options, report);
}

TEST(Simplify, ASphereStaysASphere) {
  const TriangleMesh sphere = make_sphere(5);  // 8192 faces
  SimplifyReport report;
  const TriangleMesh small = to_faces(sphere, 800, &report);
  EXPECT_TRUE(report.reached);
  EXPECT_LE(small.num_faces(), 800);
  EXPECT_GE(small.num_faces(), 798);
  const MeshReport inspected = inspect_mesh(small);
  EXPECT_TRUE(inspected.closed());
  EXPECT_EQ(inspected.euler_characteristic, 2);
  double volume = 0.0;
  for (const auto& [a, b, c] : small.faces)
    volume += small.vertices[a].dot(small.vertices[b].cross(small.vertices[c])) / 6.0;
  double full = 0.0;
  for (const auto& [a, b, c] : sphere.faces)
    full += sphere.vertices[a].dot(sphere.vertices[b].cross(sphere.vertices[c])) / 6.0;
  EXPECT_NEAR(volume / full, 1.0, 0.008);
  for (const Vector3d& v : small.vertices) EXPECT_NEAR(v.norm(), 1.0, 0.02);
  for (const auto& [a, b, c] : small.faces) {
    const Vector3d normal = (small.vertices[b] - small.vertices[a]).cross(small.vertices[c] - small.vertices[a]);
    EXPECT_GT(normal.dot(small.vertices[a]), 0.0);
  }
}

TEST(Simplify, ReachesATargetOfVertices) {
  SimplifyOptions options;
  options.target_vertices = 300;
  EXPECT_EQ(simplify(make_sphere(4), options).num_vertices(), 300);
}

TEST(Simplify, TwoRunsGiveTheSameMesh) {
  const TriangleMesh cylinder = support::make_cylinder(64, 40, 0.1, 0.5);
  const TriangleMesh a = to_faces(cylinder, 700), b = to_faces(cylinder, 700);
  EXPECT_EQ(a.faces, b.faces);
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.uvs, b.uvs);
}

TEST(Simplify, BordersOfAFlatSheetKeepItsArea) {
  const TriangleMesh sheet = support::make_sheet(30, 20);
  const TriangleMesh small = to_faces(sheet, 60);
  double area = 0.0;
  for (const auto& [a, b, c] : small.faces)
    area += 0.5 * (small.vertices[b] - small.vertices[a]).cross(small.vertices[c] - small.vertices[a]).z();
  EXPECT_NEAR(area, 600.0, 6.0);
}

/// On the cylinder, UV and position determine each other, so the texture's error can be measured everywhere.
TEST(Simplify, ACylindersTextureStaysInPlaceAndItsSeamStaysOpen) {
  const double radius = 0.1, height = 0.5;
  const TriangleMesh cylinder = support::make_cylinder(96, 60, radius, height);
  const TriangleMesh small = to_faces(cylinder, 1200);
  ASSERT_EQ(small.face_uvs.size(), small.faces.size());
  double worst = 0.0;
  for (std::size_t f = 0; f < small.faces.size(); ++f) {
    Vector3d middle = Vector3d::Zero();
    Vector2d uv = Vector2d::Zero();
    double low = 1.0, high = 0.0;
    for (int k = 0; k < 3; ++k) {
      middle += small.vertices[small.faces[f][k]] / 3.0;
      const Vector2d& corner = small.uvs[small.face_uvs[f][k]];
      uv += corner / 3.0;
      low = std::min(low, corner.x());
      high = std::max(high, corner.x());
    }
    EXPECT_LT(high - low, 0.3) << "a triangle runs across the seam";
    const double turn = std::atan2(middle.x(), middle.z()) / (2.0 * std::numbers::pi);
    const double u_error = std::remainder(uv.x() - turn, 1.0) * 2.0 * std::numbers::pi * radius;
    worst = std::max({worst, std::abs(u_error), std::abs(uv.y() * height - middle.y())});
  }
  EXPECT_LT(worst, 0.004);  // metres; edges are 12 mm long on average
  // The seam is still the line from bottom to top: its vertices have two UVs, u = 0 and u = 1.
  std::map<int, std::vector<double>> seam;
  for (std::size_t f = 0; f < small.faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const double u = small.uvs[small.face_uvs[f][k]].x();
      if (u < 1e-9 || u > 1.0 - 1e-9) seam[small.faces[f][k]].push_back(u);
    }
  ASSERT_GE(seam.size(), 5u);
  for (const auto& [v, us] : seam) {
    EXPECT_NEAR(small.vertices[v].x(), 0.0, 1e-3);
    EXPECT_LT(*std::min_element(us.begin(), us.end()), 1e-9);
    EXPECT_GT(*std::max_element(us.begin(), us.end()), 1.0 - 1e-9);
  }
}

TEST(Simplify, ColoursFollowTheSurface) {
  TriangleMesh sphere = make_sphere(5);
  for (const Vector3d& v : sphere.vertices) sphere.colours.push_back(0.5 * (v + Vector3d::Ones()));
  const TriangleMesh small = to_faces(sphere, 1000);
  ASSERT_EQ(small.colours.size(), small.vertices.size());
  for (std::size_t v = 0; v < small.vertices.size(); ++v)
    EXPECT_LT((small.colours[v] - 0.5 * (small.vertices[v] + Vector3d::Ones())).norm(), 0.02);
}

TEST(Simplify, AClosedBoxCannotBecomeFlat) {
  SimplifyReport report;
  const TriangleMesh small = to_faces(support::make_box({0, 0, 0}, {1, 1, 1}), 4, &report);
  EXPECT_TRUE(inspect_mesh(small).closed());
  EXPECT_GE(small.num_faces(), 4);
}

TEST(Simplify, TellsWhatIsWrongWithItsInput) {
  const TriangleMesh sphere = make_sphere(2);
  EXPECT_THAT(message_of<UsageError>([&] { simplify(sphere, {}); }), HasSubstr("no target"));
  EXPECT_THAT(message_of<UsageError>([&] { to_faces(sphere, 3); }), HasSubstr("at least 4"));
  TriangleMesh broken = sphere;
  broken.vertices[7].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<UsageError>([&] { to_faces(broken, 50); }),
              AllOf(HasSubstr("vertex 7 is not finite"), HasSubstr("repair")));
  SimplifyOptions tight;
  tight.target_faces = 50;
  tight.memory_limit = 1000;
  EXPECT_THAT(message_of<UsageError>([&] { simplify(sphere, tight); }), HasSubstr("GB of memory"));
}

}  // namespace
}  // namespace doppel::simplify_test
