#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/track/surface/outline_term.h"
#include "doppel/track/surface/photometric_term.h"
#include "track/surface/surface_check.h"

namespace doppel::data_terms_test {
namespace {

using support::check_surface_term;
using support::cost_of;

/// An image whose colours run smoothly over it.
cv::Mat smooth_image(const PinholeCamera& camera) {
  cv::Mat image(camera.height, camera.width, CV_8UC3);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uchar>(128 + 90 * std::sin(0.06 * x)),
                                   cv::saturate_cast<uchar>(128 + 90 * std::sin(0.05 * y + 1)),
                                   cv::saturate_cast<uchar>(60 + x / 2 + y / 2)};
  return image;
}

struct Scene {
  TriangleMesh mesh = support::bumpy_patch(6);
  MeshTopology topology{mesh};
  Eigen::Matrix3Xd vertices = support::columns(mesh.vertices);
  PinholeCamera camera = support::patch_camera();
  int count = mesh.num_vertices();
};

// ---- colours ----

struct Coloured : Scene {
  ColourPyramid pyramid{smooth_image(camera), {0, 0, camera.width, camera.height}, {15, 9, 3}};
  std::vector<char> visible = std::vector<char>(count, 1);
  Eigen::Matrix3Xd colours = Eigen::Matrix3Xd::Zero(3, count);
  /// The colours that the vertices have where they are.
  Coloured() {
    for (int i = 0; i < count; ++i) colours.col(i) = seen(2, i);
  }
  Eigen::Vector3d seen(int level, int vertex) const {
    ColourPyramid::Sample sample;
    EXPECT_TRUE(pyramid.at(level, camera.project(vertices.col(vertex)), sample));
    return sample.colour;
  }
  PhotometricTerm term(double weight, double threshold = 0.25) const {
    return {camera, pyramid, visible, colours, weight, threshold};
  }
};

TEST(ColourPyramid, SamplesPixelCentresAndItsWindowOnly) {
  cv::Mat image(20, 30, CV_8UC3, cv::Scalar(51, 102, 204));  // B G R
  const ColourPyramid pyramid(image, {10, 5, 15, 10}, {3});
  ColourPyramid::Sample sample;
  ASSERT_TRUE(pyramid.at(0, {15.5, 9.5}, sample));
  EXPECT_TRUE(sample.colour.isApprox(Eigen::Vector3d(0.8, 0.4, 0.2), 1e-5));
  EXPECT_TRUE(sample.jacobian.isZero(1e-5));
  EXPECT_FALSE(pyramid.at(0, {9.0, 9.5}, sample));
  EXPECT_FALSE(pyramid.at(0, {15.5, 15.5}, sample));
  EXPECT_FALSE(pyramid.at(0, {std::nan(""), 9.5}, sample));
  EXPECT_EQ(ColourPyramid(image, {40, 40, 10, 10}, {3}).num_levels(), 0);
}

/// On a linear ramp of colour, levels of any size have the colour and the slope of the image.
TEST(ColourPyramid, HalvedLevelsKeepPixelsOfTheImage) {
  cv::Mat image(64, 64, CV_8UC3);
  for (int v = 0; v < 64; ++v)
    for (int u = 0; u < 64; ++u) image.at<cv::Vec3b>(v, u) = cv::Vec3b::all(static_cast<uchar>(2 * u + v));
  const ColourPyramid pyramid(image, {0, 0, 64, 64}, {3, 3, 3}, true);
  for (int level = 0; level < 3; ++level) {
    ColourPyramid::Sample sample;
    ASSERT_TRUE(pyramid.at(level, {30.5, 33.5}, sample));
    EXPECT_NEAR(255.0 * sample.colour[0], 2 * 30 + 33, 0.01) << level;
    EXPECT_NEAR(255.0 * sample.jacobian(0, 0), 2.0, 0.01) << level;
    EXPECT_NEAR(255.0 * sample.jacobian(0, 1), 1.0, 0.01) << level;
  }
}

TEST(PhotometricTerm, IsTheDifferenceOfColours) {
  const Coloured scene;
  PhotometricTerm term = scene.term(1.0);
  term.set_level(2);
  term.freeze(scene.vertices);
  EXPECT_EQ(term.num_used(), scene.count);
  EXPECT_NEAR(cost_of(term, scene.count, scene.vertices), 0.0, 1e-12);
  term.set_level(0);
  term.freeze(scene.vertices);
  EXPECT_TRUE(term.rows(7, scene.vertices).values.isApprox(scene.seen(0, 7) - scene.seen(2, 7), 1e-9));
}

TEST(PhotometricTerm, JacobianAndWeight) {
  const Coloured scene;
  const Eigen::Matrix3Xd moved = support::shaken(scene.vertices, 0.008);
  PhotometricTerm term = scene.term(1.0), heavy = scene.term(3.0);
  for (const int level : {0, 1, 2}) {
    term.set_level(level);
    EXPECT_EQ(check_surface_term(term, scene.topology.edges(), moved, 1e-4), scene.count) << "level " << level;
  }
  term.set_level(2);
  EXPECT_EQ(check_surface_term(term, scene.topology.edges(), scene.vertices, 1e-4), scene.count);
  EXPECT_GT(term.rows(7, scene.vertices).jacobian.norm(), 0.1) << "jacobian where it costs nothing";
  heavy.set_level(2);
  term.freeze(moved);
  heavy.freeze(moved);
  EXPECT_NEAR(cost_of(heavy, scene.count, moved), 3.0 * cost_of(term, scene.count, moved), 1e-9);
}

TEST(PhotometricTerm, DropsWhatIsHiddenAndWhatIsOfAnotherColour) {
  Coloured scene;
  scene.visible[3] = 0;
  scene.colours.col(5).setConstant(2.0);
  PhotometricTerm term = scene.term(1.0);
  term.set_level(2);
  term.freeze(scene.vertices);
  EXPECT_EQ(term.rows(3, scene.vertices).count, 0);
  EXPECT_EQ(term.rows(5, scene.vertices).count, 0);
  EXPECT_EQ(term.num_used(), scene.count - 2);
  Eigen::Matrix3Xd away = scene.vertices;
  away.col(7).x() += 100.0;
  EXPECT_GT(term.rows(7, away).cost(), 0.0) << "leaving the image during a step is no gain";
}

// ---- outlines ----

struct Outlined : Scene {
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  OutlineField field;
  std::vector<char> parts = std::vector<char>(count, 1);
  std::vector<Eigen::Vector3d> normals;
  PartMask part_mask;
  double own_distance = 0.0;  ///< of all vertices
  Outlined() {
    cv::ellipse(mask, {95, 85}, {40, 30}, 10.0, 0.0, 360.0, cv::Scalar(255), cv::FILLED);
    field = OutlineField(mask, 128);
    const Eigen::Vector3d middle = vertices.rowwise().mean();
    for (int i = 0; i < count; ++i) normals.push_back((vertices.col(i) - middle).normalized());
  }
  OutlineTerm term(double weight, double scale = 1e6) const {
    std::vector<OutlineVertex> all;
    for (int i = 0; i < count; ++i) all.push_back({0, i, own_distance});
    return {{camera, field, part_mask, parts, normals}, all, weight, scale};
  }
};

TEST(OutlineTerm, IsTheDistanceInReferencePixels) {
  const Outlined scene;
  OutlineTerm term = scene.term(2.0);
  term.freeze(scene.vertices);
  const double scale = kReferenceWidth / scene.camera.width;
  for (int i = 0; i < scene.count; ++i) {
    const double distance = scene.field.at(scene.camera.project(scene.vertices.col(i))).distance;
    EXPECT_NEAR(std::abs(term.rows(i, scene.vertices).values[0]), scale * std::abs(distance), 1e-6);
    EXPECT_NEAR(term.rows(i, scene.vertices).weight, 2.0, 1e-6);
  }
}

TEST(OutlineTerm, AVertexWithinTheSurfacesOutlineBelongsAsMuchWithinTheMask) {
  Outlined scene;
  scene.own_distance = -7.0;
  OutlineTerm term = scene.term(1.0);
  term.freeze(scene.vertices);
  const double scale = kReferenceWidth / scene.camera.width;
  for (int i = 0; i < scene.count; ++i) {
    const double distance = scale * scene.field.at(scene.camera.project(scene.vertices.col(i))).distance;
    EXPECT_NEAR(std::abs(term.rows(i, scene.vertices).values[0]), std::abs(distance + 7.0), 1e-6);
  }
}

TEST(OutlineTerm, JacobianAndWeight) {
  const Outlined scene;
  const Eigen::Matrix3Xd moved = support::shaken(scene.vertices, 0.004);
  OutlineTerm term = scene.term(1.0), heavy = scene.term(3.0);
  EXPECT_EQ(check_surface_term(term, scene.topology.edges(), moved, 1e-4), scene.count);
  heavy.freeze(moved);
  EXPECT_NEAR(cost_of(heavy, scene.count, moved), 3.0 * cost_of(term, scene.count, moved), 1e-6);
}

TEST(OutlineTerm, AVertexOnTheWrongSideIsSentToTheOtherOutline) {
  Outlined scene;
  // Inside the mask near its left outline, but facing right.
  const Eigen::Vector3d inside(0.0, 0.1, 0.0);
  scene.vertices.col(0) = inside;
  ASSERT_LT(scene.field.at(scene.camera.project(inside)).distance, 0.0);
  const auto gradient_along_x = [&](double normal_x) {
    scene.normals[0] = {normal_x, 0.0, 0.0};
    OutlineTerm term = scene.term(1.0);
    term.freeze(scene.vertices);
    const PointRows rows = term.rows(0, scene.vertices);
    return rows.values[0] * rows.jacobian(0, 0);
  };
  EXPECT_GT(gradient_along_x(-1.0), 0.0) << "facing left: the energy falls to the left";
  EXPECT_LT(gradient_along_x(1.0), 0.0) << "facing right: to the right";
}

TEST(OutlineTerm, AnotherPartOfTheBodySaysNothing) {
  Outlined scene;
  cv::Mat parts = cv::Mat::zeros(64, 64, CV_8UC1);
  parts.colRange(0, 32).setTo(static_cast<int>(BodyPart::torso));
  scene.part_mask = PartMask(parts, {0, 0, 200}, 1);
  scene.parts.assign(scene.parts.size(), static_cast<char>(BodyPart::left_arm));
  OutlineTerm term = scene.term(1.0);
  term.freeze(scene.vertices);
  int left = 0, right = 0;
  for (int i = 0; i < scene.count; ++i) {
    const bool on_torso = scene.camera.project(scene.vertices.col(i)).x() < 103.0;
    (on_torso ? left : right) += 1;
    EXPECT_EQ(term.rows(i, scene.vertices).count, on_torso ? 0 : 1) << "vertex " << i;
  }
  EXPECT_GT(left, 0);
  EXPECT_GT(right, 0);
}

TEST(OutlineTerm, FarFromTheOutlineCountsLess) {
  const Outlined scene;
  OutlineTerm term = scene.term(1.0, 10.0);
  term.freeze(scene.vertices);
  for (int i = 0; i < scene.count; ++i) {
    const PointRows rows = term.rows(i, scene.vertices);
    EXPECT_NEAR(rows.weight, std::pow(100.0 / (100.0 + std::pow(rows.values[0], 2)), 2), 1e-9);
  }
}

TEST(OutlineTerm, WithoutAKernelAllDistancesCountAlike) {
  const Outlined scene;
  OutlineTerm term = scene.term(3.0, 0.0);
  term.freeze(scene.vertices);
  for (int i = 0; i < scene.count; ++i) EXPECT_EQ(term.rows(i, scene.vertices).weight, 3.0);
}

// ---- parts ----

TEST(PartMask, GrowsIntoGapsWhereTheTorsoWins) {
  cv::Mat parts = cv::Mat::zeros(20, 20, CV_8UC1);
  parts.colRange(0, 6).setTo(static_cast<int>(BodyPart::torso));
  parts.colRange(9, 12).setTo(static_cast<int>(BodyPart::left_arm));
  const PartMask mask(parts, {0, 0, 40}, 2);  // two pixels of the image each
  const char torso = static_cast<char>(BodyPart::torso), arm = static_cast<char>(BodyPart::left_arm);
  EXPECT_TRUE(mask.allows(torso, {3.0, 20.0}));
  EXPECT_FALSE(mask.allows(arm, {3.0, 20.0}));
  EXPECT_FALSE(mask.allows(arm, {15.0, 20.0})) << "column 7 is near both";
  EXPECT_TRUE(mask.allows(torso, {15.0, 20.0}));
  EXPECT_TRUE(mask.allows(arm, {17.0, 20.0})) << "column 8 is near the arm only";
  EXPECT_FALSE(mask.allows(torso, {19.0, 20.0})) << "what is seen stays";
  EXPECT_TRUE(mask.allows(torso, {35.0, 20.0})) << "nothing is there";
  EXPECT_TRUE(mask.allows(torso, {-5.0, 20.0})) << "outside of the window";
  EXPECT_TRUE(PartMask().allows(arm, {3.0, 20.0}));
}

TEST(BodyParts, AreToldByNames) {
  SkinningWeights skin;
  skin.bones = {"Spine", "LeftForeArm", "RightUpLeg", "LeftHip", "LeftKnee", "r_shin", "Head"};
  const std::vector<std::vector<int>> rows = {{0}, {1}, {2}, {3, 0}, {3, 4}, {5}, {6}, {4}};
  for (const auto& row : rows) {
    for (const int bone : row) {
      skin.vertex_bones.items.push_back(bone);
      skin.weights.push_back(1.0 / static_cast<double>(row.size()));
    }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  const auto c = [](BodyPart part) { return static_cast<char>(part); };
  EXPECT_EQ(body_parts(skin), (std::vector<char>{c(BodyPart::torso), c(BodyPart::left_arm), c(BodyPart::right_leg),
                                                 c(BodyPart::torso), c(BodyPart::left_leg), c(BodyPart::right_leg),
                                                 c(BodyPart::torso), c(BodyPart::left_leg)}));
}

TEST(BodyParts, WarnWhereNoNameNamesAPart) {
  SkinningWeights skin;
  skin.bones = {"bone_1", "bone_2"};
  for (const int bone : {0, 1}) {
    skin.vertex_bones.items.push_back(bone);
    skin.weights.push_back(1.0);
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  body_parts(skin);
  const std::string warning = ::testing::internal::GetCapturedStderr() + ::testing::internal::GetCapturedStdout();
  EXPECT_NE(warning.find("part mask (4.6.2) has no effect"), std::string::npos) << warning;
  EXPECT_NE(warning.find("bone_1, bone_2"), std::string::npos) << warning;
}

}  // namespace
}  // namespace doppel::data_terms_test
