#include "doppel/rigging/scan/repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "geometry/meshes.h"
#include "rigging/scan/figures.h"
#include "support/message_of.h"

namespace doppel::repair_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using support::append;
using support::make_disc;
using support::make_sphere;
using support::message_of;
using ::testing::Contains;
using ::testing::HasSubstr;

TriangleMesh moved(TriangleMesh mesh, const Vector3d& by) {
  for (Vector3d& v : mesh.vertices) v += by;
  return mesh;
}

double volume(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.faces) sum += mesh.vertices[a].dot(mesh.vertices[b].cross(mesh.vertices[c])) / 6.0;
  return sum;
}

/// Every triangle with corners of its own, as in an STL file.
TriangleMesh soup_of(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& face : mesh.faces) {
    const int first = soup.num_vertices();
    for (const int v : face) soup.vertices.push_back(mesh.vertices[v]);
    soup.faces.push_back({first, first + 1, first + 2});
  }
  return soup;
}

TEST(Repair, LeavesASoundMeshAsItIs) {
  const TriangleMesh sphere = make_sphere(3);
  const RepairedMesh repaired = repair(sphere);
  EXPECT_TRUE(repaired.report.sentences().empty());
  EXPECT_EQ(repaired.mesh.faces, sphere.faces);
  EXPECT_EQ(repaired.mesh.vertices, sphere.vertices);
  EXPECT_EQ(repaired.report.components, 1);
}

TEST(Repair, WeldsATriangleSoup) {
  const TriangleMesh sphere = make_sphere(3);
  const RepairedMesh repaired = repair(soup_of(sphere));
  EXPECT_EQ(repaired.mesh.num_vertices(), sphere.num_vertices());
  EXPECT_EQ(repaired.report.welded_vertices, 3 * sphere.num_faces() - sphere.num_vertices());
  EXPECT_TRUE(inspect_mesh(repaired.mesh).closed());
  EXPECT_THAT(repaired.report.sentences(), Contains(HasSubstr("doubled vertices")));
}

TEST(Repair, WeldingKeepsTheSeamOfTheTexture) {
  // The vertices of the cylinder's seam are doubled, as exporters do it.
  TriangleMesh cylinder = support::make_cylinder(24, 6, 0.5, 2.0), doubled = cylinder;
  doubled.vertices.clear();
  for (int j = 0; j <= 6; ++j)
    for (int k = 0; k <= 24; ++k) doubled.vertices.push_back(cylinder.vertices[j * 24 + k % 24]);
  doubled.faces = cylinder.face_uvs;
  RepairOptions options;
  options.hole_length_one_surface = 0.0;
  const RepairedMesh repaired = repair(doubled, options);
  EXPECT_EQ(repaired.report.welded_vertices, 7);
  EXPECT_EQ(inspect_mesh(repaired.mesh).boundary_edges, 48);
  EXPECT_EQ(repaired.mesh.face_uvs, cylinder.face_uvs);
  EXPECT_EQ(repaired.report.open_borders, 2);
}

TEST(Repair, NamesVerticesThatAreNotFinite) {
  TriangleMesh sphere = make_sphere(4);
  sphere.vertices[40].y() = std::numeric_limits<double>::quiet_NaN();
  sphere.vertices[77].z() = std::numeric_limits<double>::infinity();
  const RepairedMesh repaired = repair(sphere);
  EXPECT_EQ(repaired.report.lost_vertices, 2);
  EXPECT_THAT(repaired.report.sentences(), Contains(HasSubstr("numbers 40, 77")));
  // The two holes that they leave are filled.
  EXPECT_EQ(repaired.report.holes, 2);
  EXPECT_TRUE(inspect_mesh(repaired.mesh).closed());
  EXPECT_EQ(repaired.mesh.num_vertices(), sphere.num_vertices() - 2);
}

TEST(Repair, DropsDegenerateAndDoubleTriangles) {
  TriangleMesh sphere = make_sphere(3);
  const int faces = sphere.num_faces();
  sphere.faces.push_back(sphere.faces[5]);
  sphere.faces.push_back({sphere.faces[9][1], sphere.faces[9][0], sphere.faces[9][2]});
  sphere.faces.push_back({3, 3, 8});
  const RepairedMesh repaired = repair(sphere);
  EXPECT_EQ(repaired.report.duplicate_faces, 2);
  EXPECT_EQ(repaired.report.degenerate_faces, 1);
  EXPECT_EQ(repaired.mesh.num_faces(), faces);
}

TEST(Repair, TurnsFacesOutwards) {
  TriangleMesh sphere = make_sphere(3);
  for (std::size_t f = 0; f < sphere.faces.size(); f += 5) std::swap(sphere.faces[f][1], sphere.faces[f][2]);
  const RepairedMesh repaired = repair(sphere);
  EXPECT_EQ(repaired.report.turned_faces, (sphere.num_faces() + 4) / 5);
  EXPECT_NEAR(volume(repaired.mesh), volume(make_sphere(3)), 1e-9);

  TriangleMesh inside_out = make_sphere(3);
  for (Triangle& face : inside_out.faces) std::swap(face[1], face[2]);
  EXPECT_EQ(repair(inside_out).report.turned_faces, inside_out.num_faces());
  EXPECT_GT(volume(repair(inside_out).mesh), 0.0);
}

TEST(Repair, RemovesSpecksButKeepsParts) {
  TriangleMesh body = make_sphere(4);
  append(body, moved(make_sphere(2, 0.04), {0, 0, 1.02}));  // an eye
  for (int k = 0; k < 7; ++k) append(body, moved(make_sphere(1, 0.02), {1.2 + 0.1 * k, 0.3 * k - 1.0, 0.2}));
  const RepairedMesh repaired = repair(body);
  EXPECT_EQ(repaired.report.specks, 7);
  EXPECT_EQ(repaired.report.components, 2);
  EXPECT_THAT(repaired.report.sentences(), Contains(HasSubstr("7 specks")));
}

TEST(Repair, RemovesAFloorAndKeepsTheSoles) {
  const TriangleMesh figure = support::make_figure({0.5, 0.0, 0.0}, {-0.3, -0.4, 0.0});
  TriangleMesh with_floor = figure;
  append(with_floor, make_disc(0.0, 0.7));
  const RepairedMesh repaired = repair(with_floor), without = repair(figure);
  EXPECT_EQ(repaired.report.floor_faces, make_disc(0.0, 0.7).num_faces());
  EXPECT_EQ(without.report.floor_faces, 0);
  EXPECT_EQ(repaired.mesh.num_faces(), without.mesh.num_faces());
  EXPECT_THAT(repaired.report.sentences(), Contains(HasSubstr("floor under the feet")));
}

TEST(Repair, PartsSheetsThatCross) {
  // Two spheres that share one edge: four faces meet there.
  TriangleMesh pair = make_sphere(3);
  const int n = pair.num_vertices();
  const TriangleMesh other = make_sphere(3);
  append(pair, other);
  const int a = pair.faces[0][0], b = pair.faces[0][1];
  for (std::size_t f = other.faces.size(); f < pair.faces.size(); ++f)
    for (int& v : pair.faces[f]) {
      if (v == a + n) v = a;
      if (v == b + n) v = b;
    }
  for (int v = n; v < 2 * n; ++v) pair.vertices[v] += 0.7 * (pair.vertices[a] + pair.vertices[b]);
  ASSERT_EQ(inspect_mesh(pair).non_manifold_edges, 1);
  const RepairedMesh repaired = repair(pair);
  EXPECT_EQ(repaired.report.non_manifold_edges, 1);
  EXPECT_EQ(inspect_mesh(repaired.mesh).non_manifold_edges, 0);
  EXPECT_EQ(repaired.report.components, 2);
  EXPECT_EQ(repaired.mesh.num_vertices(), 2 * n);
}

TEST(Repair, FillsSmallHolesWithTheBordersColours) {
  TriangleMesh sphere = make_sphere(5);
  for (const Vector3d& v : sphere.vertices) sphere.colours.push_back(0.5 * (v + Vector3d::Ones()));
  const double full = volume(sphere);
  std::erase_if(sphere.faces, [&](const Triangle& f) {
    const Vector3d& p = sphere.vertices[f[0]];
    return (p - Vector3d::UnitX()).norm() < 0.1 || (p - Vector3d::UnitZ()).norm() < 0.1;
  });
  const RepairedMesh repaired = repair(sphere);
  EXPECT_EQ(repaired.report.holes, 2);
  EXPECT_TRUE(inspect_mesh(repaired.mesh).closed());
  EXPECT_NEAR(volume(repaired.mesh) / full, 1.0, 0.005);
  for (std::size_t v = 0; v < repaired.mesh.vertices.size(); ++v)
    EXPECT_LT((repaired.mesh.colours[v] - 0.5 * (repaired.mesh.vertices[v] + Vector3d::Ones())).norm(), 1e-12);
}

TEST(Repair, LargeOpeningsStayOpen) {
  TriangleMesh sphere = make_sphere(4);
  std::erase_if(sphere.faces, [&](const Triangle& f) { return sphere.vertices[f[0]].y() < -0.8; });
  const RepairedMesh repaired = repair(sphere);
  EXPECT_EQ(repaired.report.holes, 0);
  EXPECT_EQ(repaired.report.open_borders, 1);
}

TEST(Repair, TellsWhatIsWrongWithItsInput) {
  EXPECT_THAT(message_of<UsageError>([] {
                TriangleMesh points;
                points.vertices.resize(10, Vector3d::Zero());
                repair(points);
              }),
              HasSubstr("10 vertices but no triangles"));
  EXPECT_THAT(message_of<UsageError>([] {
                TriangleMesh sphere = make_sphere(1);
                sphere.faces[3][2] = 900;
                repair(sphere);
              }),
              HasSubstr("triangle 3 names vertex 900"));
  EXPECT_THAT(message_of<UsageError>([] {
                TriangleMesh sphere = make_sphere(1);
                for (Vector3d& v : sphere.vertices) v.x() = std::numeric_limits<double>::quiet_NaN();
                repair(sphere);
              }),
              HasSubstr("none is left"));
}

}  // namespace
}  // namespace doppel::repair_test
