#include "doppel/rigging/scan/orientation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "doppel/core/error.h"
#include "geometry/meshes.h"
#include "rigging/scan/figures.h"
#include "support/message_of.h"

namespace doppel::orientation_test {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using support::append;
using support::make_figure;
using support::message_of;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr double kHeight = 1.75;

struct Pose {
  const char* name;
  Vector3d left, right;
};
const std::vector<Pose>& poses() {
  static const std::vector<Pose> all{{"A", {0.35, -0.40, 0}, {-0.35, -0.40, 0}},
                                     {"T wider than high", {0.90, 0, 0}, {-0.90, 0, 0}},
                                     {"one arm up", {0.10, 0.60, 0}, {-0.15, -0.50, 0}},
                                     {"both arms up", {0.15, 0.65, 0}, {-0.15, 0.65, 0}}};
  return all;
}

/// A file with the given axis up, in which y-up bodies face `front`.
Matrix3d file_from_body(const Vector3d& up, const Vector3d& front) {
  Matrix3d turn;
  turn.col(0) = up.cross(front);
  turn.col(1) = up;
  turn.col(2) = front;
  return turn;
}

TriangleMesh in_file(TriangleMesh mesh, const Matrix3d& turn, double units_per_metre, const Vector3d& shift) {
  for (Vector3d& v : mesh.vertices) v = units_per_metre * (turn * v) + shift;
  return mesh;
}

struct Axis {
  const char* name;
  Vector3d up, front;
};
const std::vector<Axis>& axes() {
  static const std::vector<Axis> all{{"+x", {1, 0, 0}, {0, 0, 1}},     {"-x", {-1, 0, 0}, {0, 1, 0}},
                                     {"+y", {0, 1, 0}, {0.6, 0, 0.8}}, {"-y", {0, -1, 0}, {0, 0, -1}},
                                     {"+z", {0, 0, 1}, {0, -1, 0}},    {"-z", {0, 0, -1}, {0.8, -0.6, 0}}};
  return all;
}

void expect_found(const TriangleMesh& mesh, const Axis& axis, const std::string& unit, double height) {
  const ScanOrientation found = find_orientation(mesh);
  SCOPED_TRACE(::testing::PrintToString(found.reasons));
  EXPECT_EQ(found.up, axis.name);
  EXPECT_EQ(found.unit, unit);
  EXPECT_NEAR(found.height, height, 0.02);
  ASSERT_TRUE(found.facing.has_value());
  EXPECT_GT(found.facing->dot(axis.front), std::cos(10.0 * std::numbers::pi / 180.0));
}

TEST(Orientation, EveryPoseAndAxisIsFound) {
  for (const Pose& pose : poses()) {
    const TriangleMesh body = make_figure(pose.left, pose.right);
    double top = 0.0;
    for (const Vector3d& v : body.vertices) top = std::max(top, v.y());
    for (const Axis& axis : axes()) {
      SCOPED_TRACE(std::string(pose.name) + " " + axis.name);
      expect_found(in_file(body, file_from_body(axis.up, axis.front), 100.0, {31, -20, 7}), axis, "cm", top);
    }
  }
}

TEST(Orientation, UnitsAreFoundByTheHeight) {
  const TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  for (const auto& [unit, metres] : {std::pair("m", 1.0), std::pair("cm", 0.01), std::pair("mm", 0.001),
                                     std::pair("inch", 0.0254), std::pair("foot", 0.3048), std::pair("dm", 0.1)}) {
    SCOPED_TRACE(unit);
    const ScanOrientation found =
        find_orientation(in_file(body, file_from_body({0, 1, 0}, {0, 0, 1}), 1.0 / metres, {0, 0, 0}));
    EXPECT_EQ(found.unit, unit);
    EXPECT_NEAR(found.height, kHeight, 0.02);
  }
}

TEST(Orientation, AFloorAndSpecksDoNotMatter) {
  for (const Pose& pose : poses())
    for (const double radius : {0.4, 1.6}) {
      SCOPED_TRACE(pose.name);
      TriangleMesh body = make_figure(pose.left, pose.right);
      double top = 0.0;
      for (const Vector3d& v : body.vertices) top = std::max(top, v.y());
      append(body, support::make_disc(0.0, radius));
      for (const Vector3d& far : {Vector3d(3, 1, 9), Vector3d(-7, -4, 2), Vector3d(0, 2.6, 0)}) {
        TriangleMesh speck = support::make_sphere(1, 0.02);
        for (Vector3d& v : speck.vertices) v += far;
        append(body, speck);
      }
      const Axis& axis = axes()[4];
      const TriangleMesh file = in_file(body, file_from_body(axis.up, axis.front), 1000.0, {5, 6, 7});
      const ScanOrientation found = find_orientation(file);
      SCOPED_TRACE(::testing::PrintToString(found.reasons));
      EXPECT_TRUE(found.floor);
      EXPECT_EQ(found.up, "+z");
      EXPECT_EQ(found.unit, "mm");
      EXPECT_NEAR(found.height, top, 0.03);
    }
}

TEST(Orientation, TheCharacterFrameHasFeetAtZeroAndFacesZ) {
  const TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  const Axis& axis = axes()[5];
  const TriangleMesh file = in_file(body, file_from_body(axis.up, axis.front), 100.0, {310, -200, 70});
  const ScanOrientation found = find_orientation(file);
  const TriangleMesh back = transformed(file, found.character_from_file);
  double low = 1e9;
  Vector3d mean_error = Vector3d::Zero();
  double worst = 0.0;
  for (std::size_t v = 0; v < back.vertices.size(); ++v) {
    low = std::min(low, back.vertices[v].y());
    mean_error += (back.vertices[v] - body.vertices[v]) / static_cast<double>(back.vertices.size());
  }
  for (std::size_t v = 0; v < back.vertices.size(); ++v)
    worst = std::max(worst, (back.vertices[v] - body.vertices[v] - mean_error).norm());
  EXPECT_NEAR(low, 0.0, 1e-6);
  EXPECT_LT(worst, 0.1);  // a turn of less than 6 degrees at the hands
  OrientationOptions straight;
  straight.face_z = false;
  const Matrix3d turn = 100.0 * find_orientation(file, straight).character_from_file.topLeftCorner<3, 3>();
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(turn.row(k).cwiseAbs().maxCoeff(), 1.0, 1e-12);
  EXPECT_NEAR(turn.determinant(), 1.0, 1e-12);
}

TEST(Orientation, WhatIsGivenIsTaken) {
  const TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  OrientationOptions options;
  options.up = "-y";
  options.unit = "0.9";
  const ScanOrientation found = find_orientation(body, options);
  EXPECT_EQ(found.up, "-y");
  EXPECT_NEAR(found.height, 0.9 * kHeight, 0.02);
  EXPECT_EQ(found.confidence(), 1.0);
  EXPECT_THAT(found.reasons, Contains(HasSubstr("upside down; if it is, give --up +y")));
}

TEST(Orientation, WhatTheFileSaysIsTakenUnlessTheShapeContradictsIt) {
  const TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  OrientationOptions options;
  options.file_up = "y";
  options.file_unit = 0.9;
  ScanOrientation found = find_orientation(body, options);
  EXPECT_EQ(found.up, "+y");
  EXPECT_NEAR(found.height, 0.9 * kHeight, 0.02);
  options.file_up = "z";
  options.file_unit = 0.01;
  found = find_orientation(body, options);
  EXPECT_EQ(found.up, "+y");
  EXPECT_EQ(found.unit, "m");
  EXPECT_THAT(found.reasons, Contains(HasSubstr("the person would lie")));
  EXPECT_THAT(found.reasons, Contains(HasSubstr("the person would be 0.0")));
  options.file_up = "-y";
  EXPECT_EQ(find_orientation(body, options).up, "+y");
}

TEST(Orientation, ALeaningBodyIsNoted) {
  TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  EXPECT_THAT(find_orientation(body).reasons, ::testing::Not(Contains(HasSubstr("leans"))));
  for (Vector3d& vertex : body.vertices) vertex = Eigen::AngleAxisd(0.5, Vector3d::UnitX()) * vertex;
  EXPECT_THAT(find_orientation(body).reasons, Contains(HasSubstr("leans by")));
}

TEST(Orientation, TwoPeopleAreNoticed) {
  const TriangleMesh one = make_figure(poses()[0].left, poses()[0].right);
  TriangleMesh two = one, other = one;
  for (Vector3d& v : other.vertices) v.x() += 1.5;
  append(two, other);
  EXPECT_GT(find_orientation(one).shape.largest_share, 0.95);
  EXPECT_LT(find_orientation(two).shape.largest_share, 0.6);
}

TEST(Orientation, AMirroringTransformKeepsFacesOutwards) {
  Matrix4d mirror = Matrix4d::Identity();
  mirror(0, 0) = -1.0;
  const TriangleMesh sphere = support::make_sphere(2), image = transformed(sphere, mirror);
  const auto& [a, b, c] = image.faces[0];
  const Vector3d normal = (image.vertices[b] - image.vertices[a]).cross(image.vertices[c] - image.vertices[a]);
  EXPECT_GT(normal.dot(image.vertices[a]), 0.0);
}

TEST(Orientation, TellsWhatIsWrongWithItsInput) {
  const TriangleMesh body = make_figure(poses()[0].left, poses()[0].right);
  const auto with = [](const std::string& unit, const std::string& up) {
    OrientationOptions options;
    options.unit = unit;
    options.up = up;
    return options;
  };
  EXPECT_THAT(message_of<UsageError>([&] { find_orientation(body, with("yard", "")); }),
              AllOf(HasSubstr("\"yard\" is no unit"), HasSubstr("inch")));
  EXPECT_THAT(message_of<UsageError>([&] { find_orientation(body, with("", "w")); }), HasSubstr("\"w\" is no axis"));
  EXPECT_THAT(message_of<UsageError>([&] { find_orientation(body, with("mm", "")); }),
              AllOf(HasSubstr("0.00175 m high"), HasSubstr("another --unit")));
  const TriangleMesh tiny = in_file(body, Matrix3d::Identity(), 0.01, Vector3d::Zero());
  EXPECT_THAT(message_of<UsageError>([&] { find_orientation(tiny); }),
              AllOf(HasSubstr("0.0175 units high"), HasSubstr("give --unit")));
  TriangleMesh empty = body;
  for (Vector3d& v : empty.vertices) v.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<UsageError>([&] { find_orientation(empty); }), HasSubstr("no triangle has finite corners"));
}

}  // namespace
}  // namespace doppel::orientation_test
