#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "doppel/core/statistics.h"
#include "doppel/geometry/topology.h"
#include "doppel/geometry/triangle_tree.h"
#include "doppel/rigging/scan/orientation.h"
#include "doppel/rigging/scan/repair.h"
#include "doppel/rigging/scan/simplify.h"
#include "doppel/rigging/scan/voxel_solid.h"
#include "support/shared_folder.h"

namespace doppel::real_scan_test {
namespace {

namespace fs = std::filesystem;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

constexpr const char* kScans[] = {"mh_girl_dress", "mh_man_old_suit"};
constexpr const char* kBodies[] = {"cesium_man",    "m2m_female",           "m2m_male_apose",
                                   "mh_girl_dress", "mh_man_old_suit",      "mh_man_workwear",
                                   "mh_woman_slim", "quaternius_dress_fbx", "robot_expressive"};
constexpr const char* kLimbJoints[] = {"shoulder", "elbow", "wrist", "hip", "knee", "ankle"};

Vector3d direction_of(const nlohmann::json& value) {
  if (value.is_array()) return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
  const auto text = value.get<std::string>();
  return (text[0] == '-' ? -1.0 : 1.0) * Vector3d::Unit(text[1] - 'x');
}

class RealScan : public support::SharedFolderTest {
 protected:
  fs::path folder(const std::string& body) const { return shared_ / "bodies" / body; }
  nlohmann::json ground_truth(const std::string& body, const char* file) const {
    std::ifstream stream(folder(body) / file);
    return nlohmann::json::parse(stream);
  }
  TriangleMesh read(const std::string& body, const char* file) const { return read_obj(folder(body) / file, 1.0); }
  TriangleMesh character(const std::string& body) const {
    const TriangleMesh scan = read(body, "scan.obj");
    return transformed(scan, find_orientation(scan).character_from_file);
  }
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (!IsSkipped() && !fs::is_directory(shared_ / "bodies")) GTEST_SKIP() << "the shared data has no bodies";
  }
};

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

TEST_F(RealScan, UnitUpAndFacingOfScansAreFound) {
  for (const char* body : kScans) {
    SCOPED_TRACE(body);
    const nlohmann::json scan = ground_truth(body, "scan_truth.json");
    const ScanOrientation found = find_orientation(read(body, "scan.obj"));
    SCOPED_TRACE(::testing::PrintToString(found.reasons));
    EXPECT_EQ(found.unit, scan["units"].get<std::string>());
    EXPECT_EQ(found.up, scan["up"].get<std::string>());
    EXPECT_NEAR(found.height, ground_truth(body, "truth.json")["height"].get<double>(), 0.02);
    ASSERT_TRUE(found.facing.has_value());
    EXPECT_LT(degrees_between(*found.facing, direction_of(scan["facing"])), 10.0);
    EXPECT_FALSE(found.floor);
    EXPECT_GT(found.confidence(), 0.8);
  }
}

TEST_F(RealScan, BodiesAreFoundInAnyFrameAndUnit) {
  const std::pair<const char*, double> units[] = {{"m", 1.0},    {"cm", 100.0}, {"mm", 1000.0},
                                                  {"cm", 100.0}, {"m", 1.0},    {"mm", 1000.0}};
  const char* names[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  for (const char* body : kBodies) {
    const TriangleMesh mesh = read(body, "body.obj");
    const Vector3d front = direction_of(ground_truth(body, "truth.json")["facing"]);
    for (int axis = 0; axis < 6; ++axis) {
      SCOPED_TRACE(std::string(body) + " " + names[axis]);
      // y goes to the axis; a turn about it by an angle of no significance comes first.
      const Vector3d up = (axis % 2 == 0 ? 1.0 : -1.0) * Vector3d::Unit(axis / 2);
      const Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitY(), up).toRotationMatrix() *
                            Eigen::AngleAxisd(0.7 + 1.1 * axis, Vector3d::UnitY()).toRotationMatrix();
      Matrix4d file_from_body = Matrix4d::Identity();
      file_from_body.topLeftCorner<3, 3>() = units[axis].second * turn;
      file_from_body.topRightCorner<3, 1>() = units[axis].second * Vector3d(0.4, -1.3, 2.1);
      const ScanOrientation found = find_orientation(transformed(mesh, file_from_body));
      SCOPED_TRACE(::testing::PrintToString(found.reasons));
      EXPECT_EQ(found.up, names[axis]);
      EXPECT_EQ(found.unit, units[axis].first);
      if (std::string(body) == "robot_expressive") continue;  // its shins are boots as wide as its feet
      ASSERT_TRUE(found.facing.has_value());
      EXPECT_LT(degrees_between(*found.facing, turn * front), 15.0);
    }
  }
}

TEST_F(RealScan, SpecksAndHolesAreCountedAndMended) {
  for (const char* body : kScans) {
    SCOPED_TRACE(body);
    const nlohmann::json scan = ground_truth(body, "scan_truth.json");
    const RepairedMesh repaired = repair(character(body));
    SCOPED_TRACE(::testing::PrintToString(repaired.report.sentences()));
    // A speck that touches the body counts as a part of it.
    const int specks = scan["floating_specks"].get<int>();
    EXPECT_LE(repaired.report.specks, specks);
    EXPECT_GE(repaired.report.specks, 0.95 * specks);
    EXPECT_GT(repaired.report.holes, 0);
    EXPECT_EQ(inspect_mesh(repaired.mesh).non_manifold_edges, 0);
    EXPECT_EQ(repaired.report.open_borders, 0);
  }
}

TEST_F(RealScan, RepairKeepsTheParts) {
  for (const char* body : kBodies) {
    SCOPED_TRACE(body);
    const TriangleMesh mesh = read(body, "body.obj");
    const RepairedMesh repaired = repair(mesh);
    SCOPED_TRACE(::testing::PrintToString(repaired.report.sentences()));
    EXPECT_EQ(repaired.report.specks, 0);
    EXPECT_EQ(repaired.report.floor_faces, 0);
    EXPECT_EQ(inspect_mesh(repaired.mesh).non_manifold_edges, 0);
  }
}

TEST_F(RealScan, LimbJointsLieInTheSolid) {
  std::vector<std::pair<std::string, const char*>> cases;
  for (const char* body : kBodies) cases.emplace_back(body, "truth.json");
  for (const char* body : kScans) cases.emplace_back(body, "scan_truth.json");
  for (const auto& [body, file] : cases) {
    if (body == "robot_expressive") continue;  // joints beside its parts
    const bool is_scan = std::string(file) == "scan_truth.json";
    const TriangleMesh mesh = read(body, is_scan ? "scan.obj" : "body.obj");
    const Matrix4d to_metres = is_scan ? find_orientation(mesh).character_from_file : Matrix4d(Matrix4d::Identity());
    const VoxelSolid solid(repair(transformed(mesh, to_metres)).mesh);
    const nlohmann::json landmarks = ground_truth(body, file)["landmarks"];
    for (const char* joint : kLimbJoints)
      for (const char* side : {"l_", "r_"}) {
        const nlohmann::json& p = landmarks[std::string(side) + joint];
        const Vector3d position =
            (to_metres * Eigen::Vector4d(p[0].get<double>(), p[1].get<double>(), p[2].get<double>(), 1.0)).head<3>();
        EXPECT_TRUE(solid.inside(position))
            << body << " " << file << " " << side << joint << " depth " << solid.depth(position);
      }
  }
}

TEST_F(RealScan, SimplifiedScansStayNear) {
  for (const char* body : kScans) {
    SCOPED_TRACE(body);
    const TriangleMesh mesh = repair(character(body)).mesh;
    SimplifyOptions options;
    options.target_faces = 10000;
    const TriangleMesh small = simplify(mesh, options);
    EXPECT_LE(small.num_faces(), 10000);
    const TriangleTree there(mesh.vertices, mesh.faces), here(small.vertices, small.faces);
    std::vector<double> distances;
    for (const Vector3d& v : small.vertices) distances.push_back(std::sqrt(there.closest(v).squared_distance));
    for (const Vector3d& v : mesh.vertices) distances.push_back(std::sqrt(here.closest(v).squared_distance));
    // The scans carry noise of 1 mm.
    EXPECT_LT(median(distances), 0.001);
    EXPECT_LT(quantile(distances, 0.99), 0.004);
    EXPECT_LT(*std::max_element(distances.begin(), distances.end()), 0.015);
  }
}

}  // namespace
}  // namespace doppel::real_scan_test
