#include "doppel/track/surface/snapping.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "track/surface/surface_check.h"

namespace doppel::snapping_test {
namespace {

/// A flat patch whose left border lies some pixels off the left border of a mask.
struct Border {
  TriangleMesh mesh = support::bumpy_patch(7);
  MeshTopology topology{mesh};
  PinholeCamera camera = support::patch_camera();
  Eigen::Matrix3Xd vertices = support::columns(mesh.vertices);
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  OutlineField field;
  PartMask parts;
  std::vector<char> vertex_part = std::vector<char>(mesh.vertices.size(), 1);
  std::vector<Eigen::Vector3d> normals = std::vector<Eigen::Vector3d>(mesh.vertices.size(), {-1.0, 0.0, 0.0});
  std::vector<double> rigidity = std::vector<double>(mesh.vertices.size(), 1.0);
  std::vector<OutlineVertex> outline;  ///< the left border, without its ends

  explicit Border(int left) {
    vertices.row(2).setZero();
    mask(cv::Rect(left, 30, 180 - left, 110)).setTo(255);
    field = OutlineField(mask, 256);
    for (int y = 1; y < 6; ++y) outline.push_back({0, 7 * y, 0.0});
  }
  OutlineTerm::Evidence evidence() const { return {camera, field, parts, vertex_part, normals}; }
  double column(const Eigen::Matrix3Xd& points, int vertex) const { return camera.project(points.col(vertex)).x(); }
};

TEST(Snapping, PutsOutlineVerticesOntoTheOutlineAtTheirDepth) {
  const Border border(69);  // the vertices' own column is 72
  Eigen::Matrix3Xd moved = border.vertices;
  EXPECT_EQ(snap_outline(moved, border.evidence(), border.outline, border.topology, border.rigidity, {}), 5);
  for (const OutlineVertex& vertex : border.outline) {
    EXPECT_NEAR(border.column(moved, vertex.vertex), 69.0, 0.3);
    EXPECT_NEAR(moved(2, vertex.vertex), 0.0, 1e-9);
    const double neighbour =
        border.column(moved, vertex.vertex + 1) - border.column(border.vertices, vertex.vertex + 1);
    EXPECT_LT(neighbour, -0.3) << "its neighbours follow";
    EXPECT_GT(neighbour, -3.0);
  }
}

TEST(Snapping, LeavesWhatIsStiffFarTurnedAwayOrOfAnotherPart) {
  const auto snapped = [](const Border& border) {
    Eigen::Matrix3Xd moved = border.vertices;
    const int count = snap_outline(moved, border.evidence(), border.outline, border.topology, border.rigidity, {});
    EXPECT_EQ(count == 0, moved == border.vertices);
    return count;
  };
  EXPECT_EQ(snapped(Border(55)), 0) << "17 of 200 pixels are 46 of the thesis's";
  Border stiff(69);
  stiff.rigidity.assign(stiff.rigidity.size(), 50.0);
  EXPECT_EQ(snapped(stiff), 0);
  SnapOptions thesis;
  thesis.max_rigidity = 200.0;
  Eigen::Matrix3Xd moved = stiff.vertices;
  EXPECT_EQ(snap_outline(moved, stiff.evidence(), stiff.outline, stiff.topology, stiff.rigidity, {}, thesis), 5);
  Border turned(69);
  turned.normals.assign(turned.normals.size(), {1.0, 0.0, 0.0});
  EXPECT_EQ(snapped(turned), 0);
  Border other(69);
  cv::Mat parts = cv::Mat::zeros(100, 100, CV_8UC1);
  parts.colRange(0, 35).setTo(static_cast<int>(BodyPart::left_arm));
  other.parts = PartMask(parts, {0, 0, 200}, 0);
  EXPECT_EQ(snapped(other), 0);
}

TEST(Snapping, NewcomersComeSlowly) {
  const Border border(69);
  Eigen::Matrix3Xd moved = border.vertices;
  std::vector<char> before(border.rigidity.size(), 1);
  before[14] = 0;
  snap_outline(moved, border.evidence(), border.outline, border.topology, border.rigidity, before);
  EXPECT_NEAR(border.column(moved, 14), 72.0 - 0.7 * 3.0, 0.3);
  EXPECT_NEAR(border.column(moved, 21), 69.0, 0.3);
}

TEST(Snapping, AVertexBelongsAsFarWithinTheMaskAsWithinTheSurface) {
  Border border(69);
  for (OutlineVertex& vertex : border.outline) vertex.distance = -1.0 * kReferenceWidth / border.camera.width;
  Eigen::Matrix3Xd moved = border.vertices;
  snap_outline(moved, border.evidence(), border.outline, border.topology, border.rigidity, {});
  EXPECT_NEAR(border.column(moved, 21), 70.0, 0.3) << "one pixel within";
}

TEST(LonelyMotion, IsHeldToThatOfTheNeighbours) {
  const Border border(69);
  Eigen::Matrix3Xd moved = border.vertices;
  moved.row(2).array() += 0.01;
  Eigen::Matrix3Xd strays = moved;
  strays(0, 24) += 0.3;
  EXPECT_EQ(clamp_isolated_motion(strays, border.vertices, border.topology, 5.0), 1);
  EXPECT_NEAR((strays.col(24) - border.vertices.col(24)).norm(), 0.01, 1e-9);
  strays.col(24) = moved.col(24);
  EXPECT_TRUE(strays == moved) << "the others are left alone";
  EXPECT_EQ(clamp_isolated_motion(moved, border.vertices, border.topology, 5.0), 0);
}

}  // namespace
}  // namespace doppel::snapping_test
