#include "doppel/geometry/topology.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "doppel/core/error.h"
#include "geometry/meshes.h"

namespace doppel::topology_test {
namespace {

using support::make_sheet;
using support::make_sphere;
using ::testing::ElementsAre;

constexpr double kFar = std::numeric_limits<double>::infinity();

/// All shortest paths by Floyd and Warshall, with `length` per edge.
template <typename Length>
std::vector<std::vector<double>> all_distances(const MeshTopology& topology, const Length& length) {
  const int n = topology.num_vertices();
  std::vector<std::vector<double>> d(n, std::vector<double>(n, kFar));
  for (int i = 0; i < n; ++i) d[i][i] = 0;
  for (const auto& [a, b] : topology.edges()) d[a][b] = d[b][a] = length(a, b);
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) d[i][j] = std::min(d[i][j], d[i][k] + d[k][j]);
    }
  }
  return d;
}

/// A soup of random triangles: not a surface, but a topology all the same.
TriangleMesh random_soup(int vertices, int faces) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  TriangleMesh mesh;
  for (int v = 0; v < vertices; ++v) mesh.vertices.emplace_back(unit(generator), unit(generator), unit(generator));
  for (int f = 0; f < faces; ++f) {
    mesh.faces.push_back({static_cast<int>(generator() % vertices), static_cast<int>(generator() % vertices),
                          static_cast<int>(generator() % vertices)});
  }
  return mesh;
}

std::vector<TriangleMesh> example_meshes() { return {make_sphere(2), make_sheet(6, 4), random_soup(60, 30)}; }

std::vector<int> neighbours_of(const std::vector<Triangle>& faces, int face) {
  const IndexRows rows = face_neighbours(faces);
  return {rows.row(face).begin(), rows.row(face).end()};
}

TEST(TopologyAgrees, FaceNeighboursWithThePairsOfFacesThatShareAnEdge) {
  for (const TriangleMesh& mesh : example_meshes()) {
    ASSERT_EQ(face_neighbours(mesh.faces).num_rows(), mesh.num_faces());
    for (int f = 0; f < mesh.num_faces(); ++f) {
      std::vector<int> expected;
      for (int g = 0; g < mesh.num_faces(); ++g) {
        std::set<int> shared;
        for (const int v : mesh.faces[f])
          if (std::count(mesh.faces[g].begin(), mesh.faces[g].end(), v)) shared.insert(v);
        if (g != f && shared.size() >= 2) expected.push_back(g);
      }
      EXPECT_EQ(neighbours_of(mesh.faces, f), expected) << f;
    }
  }
  EXPECT_THAT(neighbours_of({{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}, 0), ElementsAre(1, 2)) << "three on one edge";
}

TEST(TopologyAgrees, EdgesAndRingsWithTheFaces) {
  for (const TriangleMesh& mesh : example_meshes()) {
    std::set<std::array<int, 2>> expected;
    for (const Triangle& face : mesh.faces) {
      for (int a : face) {
        for (int b : face) {
          if (a < b) expected.insert({a, b});
        }
      }
    }
    const MeshTopology topology(mesh);
    EXPECT_EQ(topology.edges(), (std::vector<std::array<int, 2>>(expected.begin(), expected.end())));
    for (int v = 0; v < mesh.num_vertices(); ++v) {
      std::vector<int> ring;
      for (int w = 0; w < mesh.num_vertices(); ++w) {
        if (expected.count({std::min(v, w), std::max(v, w)})) ring.push_back(w);
      }
      EXPECT_THAT(topology.one_ring().row(v), testing::ElementsAreArray(ring));
    }
  }
}

TEST(TopologyAgrees, BallsWithAllPairs) {
  for (const TriangleMesh& mesh : example_meshes()) {
    const MeshTopology topology(mesh);
    const auto hops = all_distances(topology, [](int, int) { return 1.0; });
    for (int source = 0; source < mesh.num_vertices(); source += 7) {
      for (int reach : {0, 1, 3, 1000}) {
        std::vector<std::pair<int, int>> expected;
        for (int v = 0; v < mesh.num_vertices(); ++v) {
          if (hops[source][v] <= reach) expected.emplace_back(v, static_cast<int>(hops[source][v]));
        }
        std::sort(expected.begin(), expected.end(), [](const auto& a, const auto& b) {
          return std::pair(a.second, a.first) < std::pair(b.second, b.first);
        });
        EXPECT_EQ(topology.ball(source, reach), expected);
      }
    }
  }
}

TEST(TopologyAgrees, GeodesicBallsWithAllPairs) {
  for (const TriangleMesh& mesh : example_meshes()) {
    const MeshTopology topology(mesh);
    const auto lengths =
        all_distances(topology, [&](int a, int b) { return (mesh.vertices[a] - mesh.vertices[b]).norm(); });
    for (int source = 0; source < mesh.num_vertices(); source += 7) {
      const double reach = 1.2345;
      const auto ball = topology.geodesic_ball(source, reach, mesh.vertices);
      const auto within = [&](double length) { return length <= reach; };
      EXPECT_EQ(static_cast<std::ptrdiff_t>(ball.size()),
                std::count_if(lengths[source].begin(), lengths[source].end(), within));
      for (std::size_t i = 0; i < ball.size(); ++i) {
        EXPECT_NEAR(ball[i].second, lengths[source][ball[i].first], 1e-12);
        EXPECT_TRUE(i == 0 || ball[i - 1].second <= ball[i].second);
      }
    }
  }
}

TEST(TopologyReference, Components) {
  const MeshTopology topology(6, {{1, 4}, {0, 3}, {3, 5}, {4, 1}});
  EXPECT_THAT(topology.edges(), ElementsAre(std::array{0, 3}, std::array{1, 4}, std::array{3, 5}));
  EXPECT_THAT(topology.components(), ElementsAre(0, 1, 2, 0, 1, 0));
}

TEST(TopologyRejects, ImpossibleIndices) {
  EXPECT_THROW(MeshTopology(3, {{0, 3}}), Error);
  EXPECT_THROW(MeshTopology(3, {{-1, 2}}), Error);
  EXPECT_THROW(MeshTopology(3, {{1, 1}}), Error);
  TriangleMesh mesh = make_sheet(1, 1);
  mesh.faces[0][1] = 4;
  EXPECT_THROW(MeshTopology{mesh}, Error);
  EXPECT_THROW(inspect_mesh(mesh), Error);
}

TEST(InspectMeshReference, SphereAndSheet) {
  const MeshReport sphere = inspect_mesh(make_sphere(2));
  EXPECT_TRUE(sphere.closed());
  EXPECT_EQ(sphere.components, 1);
  EXPECT_EQ(sphere.euler_characteristic, 2);
  EXPECT_EQ(sphere.degenerate_faces, 0);
  const MeshReport sheet = inspect_mesh(make_sheet(5, 3));
  EXPECT_FALSE(sheet.closed());
  EXPECT_EQ(sheet.boundary_edges, 16);
  EXPECT_EQ(sheet.euler_characteristic, 1);
}

TEST(InspectMeshReference, FindsPlantedFaults) {
  TriangleMesh mesh = make_sheet(2, 2);
  mesh.vertices.emplace_back(9, 9, 9);      // 9: alone
  mesh.vertices.emplace_back(0.5, 0.5, 1);  // 10: a fin on the inner edge 0-4
  mesh.faces.push_back({0, 4, 10});
  mesh.vertices.emplace_back(0.5, 0, 0);  // 11: on the edge 0-1, a face without area
  mesh.faces.push_back({1, 0, 11});
  const MeshReport report = inspect_mesh(mesh);
  EXPECT_EQ(report.isolated_vertices, 1);
  EXPECT_EQ(report.non_manifold_edges, 1);
  EXPECT_EQ(report.degenerate_faces, 1);
  EXPECT_EQ(report.components, 1);

  TriangleMesh turned = make_sphere(1);
  std::swap(turned.faces[0][0], turned.faces[0][1]);
  EXPECT_EQ(inspect_mesh(turned).non_manifold_edges, 3) << "a face against its neighbours";
}

TEST(DecimateRecovers, TheSphereWithFewerVertices) {
  const TriangleMesh mesh = make_sphere(4);
  for (int target : {500, 200, 60}) {
    const TriangleMesh coarse = decimate(mesh, target);
    EXPECT_EQ(coarse.num_vertices(), target);
    const MeshReport report = inspect_mesh(coarse);
    EXPECT_TRUE(report.closed());
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_EQ(report.degenerate_faces, 0);
    for (const Eigen::Vector3d& v : coarse.vertices) EXPECT_NEAR(v.norm(), 1, 1e-12) << "off the surface";
    // A spherical cap over an edge of the coarse mesh (about 3.8 / sqrt(target) long, twice that at worst).
    double farthest = 0;
    for (const Eigen::Vector3d& v : mesh.vertices) farthest = std::max(farthest, support::distance_to_mesh(v, coarse));
    EXPECT_LT(farthest, 7.6 * 7.6 / target / 8) << target;
    EXPECT_GT(farthest, 0);
  }
}

TEST(DecimateRecovers, AFlatSheetKeepsItsOutline) {
  const TriangleMesh mesh = make_sheet(20, 20), coarse = decimate(mesh, 100);
  EXPECT_EQ(coarse.num_vertices(), 100);
  EXPECT_EQ(inspect_mesh(coarse).euler_characteristic, 1);
  double area = 0;
  for (const auto& [a, b, c] : coarse.faces) {
    const Eigen::Vector3d twice =
        (coarse.vertices[b] - coarse.vertices[a]).cross(coarse.vertices[c] - coarse.vertices[a]);
    EXPECT_GT(twice.z(), 0) << "a face was turned over";
    area += twice.z() / 2;
  }
  EXPECT_NEAR(area, 400, 1e-9);
}

TEST(DecimateReference, SameInputSameResult) {
  const TriangleMesh mesh = make_sphere(4), a = decimate(mesh, 123), b = decimate(mesh, 123);
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.faces, b.faces);
}

TEST(DecimateReference, ATargetAboveTheMeshChangesNothing) {
  TriangleMesh mesh = make_sphere(1);
  mesh.vertices.emplace_back(7, 7, 7);
  const TriangleMesh same = decimate(mesh, 1000);
  EXPECT_EQ(same.num_vertices(), mesh.num_vertices() - 1) << "a vertex without a face is dropped";
  EXPECT_EQ(same.num_faces(), mesh.num_faces());
}

TEST(DecimateRejects, WhatCannotBeDecimated) {
  EXPECT_THROW(decimate(make_sphere(2), 3), Error);
  TriangleMesh fin = make_sheet(2, 2);
  fin.vertices.emplace_back(0.5, 0.5, 1);
  fin.faces.push_back({0, 4, 9});
  EXPECT_THROW(decimate(fin, 5), Error);
  TriangleMesh pinched = make_sheet(2, 2);
  pinched.faces[0][0] = pinched.faces[0][1];
  EXPECT_THROW(decimate(pinched, 5), Error);
  // Forty tetrahedra have no edge left to collapse.
  TriangleMesh crumbs;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d origin(3 * i, 0, 0);
    crumbs.vertices.push_back(origin);
    for (int axis = 0; axis < 3; ++axis) crumbs.vertices.push_back(origin + Eigen::Vector3d::Unit(axis));
    const int v = 4 * i;
    crumbs.faces.insert(crumbs.faces.end(),
                        {{v, v + 2, v + 1}, {v, v + 1, v + 3}, {v, v + 3, v + 2}, {v + 1, v + 2, v + 3}});
  }
  EXPECT_TRUE(inspect_mesh(crumbs).closed());
  EXPECT_THROW(decimate(crumbs, 50), Error);
}

}  // namespace
}  // namespace doppel::topology_test
