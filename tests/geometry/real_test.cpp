#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "doppel/geometry/mesh.h"
#include "doppel/geometry/topology.h"
#include "support/shared_folder.h"

namespace doppel::real_geometry_test {
namespace {

class RealGeometry : public support::SharedFolderTest {};

TEST_F(RealGeometry, TheTemplateIsOneClosedSurface) {
  const auto start = std::chrono::steady_clock::now();
  const TriangleMesh mesh = read_obj(capture_folder() / "character/ddc.obj", 0.001);
  RecordProperty(
      "milliseconds",
      static_cast<int>(1000 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()));
  EXPECT_EQ(mesh.num_vertices(), 5514);
  EXPECT_EQ(mesh.num_faces(), 11024);
  EXPECT_EQ(mesh.colours.size(), 5514u);
  EXPECT_EQ(mesh.face_uvs.size(), 11024u);
  EXPECT_FALSE(mesh.texture.empty());
  const MeshReport report = inspect_mesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.euler_characteristic, 2);

  Eigen::Vector3d lowest = mesh.vertices[0], highest = mesh.vertices[0];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    lowest = lowest.cwiseMin(v);
    highest = highest.cwiseMax(v);
  }
  EXPECT_GT((highest - lowest).maxCoeff(), 1.4) << "a person, in metres";
  EXPECT_LT((highest - lowest).maxCoeff(), 2.2);
}

TEST_F(RealGeometry, TheTemplateDecimatesToAGraph) {
  const TriangleMesh coarse = decimate(read_obj(capture_folder() / "character/ddc.obj", 0.001), 500);
  EXPECT_EQ(coarse.num_vertices(), 500);
  const MeshReport report = inspect_mesh(coarse);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.euler_characteristic, 2);
}

}  // namespace
}  // namespace doppel::real_geometry_test
