#include "doppel/track/surface/nonrigid_stage.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <cmath>

#include "doppel/track/surface/vertex_colours.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::nonrigid_stage_test {
namespace {

using Eigen::Vector3d;
using support::message_of;

NonrigidOptions all_cloth() {
  NonrigidOptions options;
  options.materials = false;
  return options;
}

/// A bent tube that one camera looks at, and the same tube with a bulge, as it really is.
struct Bulge {
  Character character = make_test_character(4, 24, 40);
  PoseModel model{character, {}, all_dofs(character)};
  std::vector<double> dofs = bent_pose(character, 0.02);
  PosedSurface posed;
  PinholeCamera camera;
  Eigen::Matrix3Xd ground_truth;
  cv::Mat mask, image;
  OutlineField outline;

  Bulge() {
    for (Vector3d& vertex : character.mesh.vertices) character.mesh.colours.push_back(colour_at(vertex));
    posed = pose_surface(model, model.pose(dofs, false), character.mesh.vertices);
    camera = ring_of_cameras(1, 600, middle_of(character)).front();
    ground_truth = posed.vertices;
    const Vector3d middle = ground_truth.rowwise().mean();
    for (Eigen::Index i = 0; i < ground_truth.cols(); ++i)
      ground_truth.col(i) += 0.03 * std::exp(-40.0 * std::pow(ground_truth(1, i) - middle.y(), 2)) * posed.normals[i];
    draw();
    outline = OutlineField(mask, 256);
  }
  static Vector3d colour_at(const Vector3d& vertex) {
    return Vector3d(0.5 + 0.3 * std::sin(20.0 * vertex.y()), 0.5 + 0.3 * std::cos(14.0 * vertex.y()), 0.4);
  }
  /// Far faces first, in their colours.
  void draw() {
    mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
    image = cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar(20, 20, 20));
    std::vector<std::pair<double, const Triangle*>> order;
    for (const Triangle& face : character.mesh.faces)
      order.emplace_back(-camera.camera_from_world(ground_truth.col(face[0])).z(), &face);
    std::sort(order.begin(), order.end());
    for (const auto& [depth, face] : order) {
      std::vector<cv::Point> corners;
      Vector3d colour = Vector3d::Zero();
      for (const int vertex : *face) {
        const Eigen::Vector2d pixel = camera.project(ground_truth.col(vertex));
        corners.emplace_back(cvRound(256.0 * (pixel.x() - 0.5)), cvRound(256.0 * (pixel.y() - 0.5)));
        colour += 255.0 / 3.0 * character.mesh.colours[vertex];
      }
      cv::fillConvexPoly(mask, corners, cv::Scalar(255), cv::LINE_8, 8);
      cv::fillConvexPoly(image, corners, cv::Scalar(colour.z(), colour.y(), colour.x()), cv::LINE_8, 8);
    }
  }
  /// Mean distance to the ground truth of vertices on the outline, across the line of sight, metres.
  double error(const Eigen::Matrix3Xd& vertices) const {
    double sum = 0.0;
    int count = 0;
    for (Eigen::Index i = 0; i < ground_truth.cols(); ++i) {
      const Vector3d to_camera = (camera.centre() - ground_truth.col(i)).normalized();
      if (std::abs(to_camera.dot(posed.normals[i])) > 0.25) continue;
      const Vector3d way = vertices.col(i) - ground_truth.col(i);
      sum += std::abs(way.dot(posed.normals[i]));
      ++count;
    }
    return sum / count;
  }
};

TEST(NonrigidStage, FindsABulgeFromTheOutline) {
  const Bulge bulge;
  NonrigidStage stage(bulge.character, bulge.camera, all_cloth());
  NonrigidSurface found;
  for (int frame = 0; frame < 4; ++frame) found = stage.fit(bulge.posed, bulge.outline, bulge.image);
  EXPECT_GT(found.outline_vertices, 20);
  EXPECT_GT(found.coloured_vertices, 20);
  EXPECT_LT(bulge.error(found.vertices), 0.5 * bulge.error(bulge.posed.vertices));
  ASSERT_EQ(found.terms.size(), 7u) << "with velocity and acceleration after two frames";
  for (const TermCost& term : found.terms) EXPECT_TRUE(std::isfinite(term.cost)) << term.name;
}

TEST(NonrigidStage, WithoutOwnDistancesVerticesAreSnappedOntoTheOutlineOfTheMask) {
  const Bulge bulge;
  const auto mean_distance = [&](bool own_distance) {  // from the outline of the mask, pixels
    NonrigidOptions options = all_cloth();
    options.own_distance = own_distance;
    options.max_isolated_motion = 0.0;
    options.snapping.first_share = 1.0;
    NonrigidStage stage(bulge.character, bulge.camera, options);
    NonrigidSurface found;
    for (int frame = 0; frame < 4; ++frame) found = stage.fit(bulge.posed, bulge.outline, bulge.image);
    double sum = 0.0;
    int count = 0;
    for (Eigen::Index i = 0; i < found.vertices.cols(); ++i) {
      const Vector3d to_camera = (bulge.camera.centre() - found.vertices.col(i)).normalized();
      if (std::abs(to_camera.dot(bulge.posed.normals[i])) > 0.1) continue;
      sum += std::abs(bulge.outline.at(bulge.camera.project(found.vertices.col(i))).distance);
      ++count;
    }
    EXPECT_GT(count, 20);
    return sum / count;
  };
  const double relative = mean_distance(true), printed = mean_distance(false);
  EXPECT_LT(printed, 0.5 * relative) << relative << " and " << printed << " pixels";
}

TEST(NonrigidStage, WarpedDisplacementsStartAhead) {
  const Bulge bulge;
  NonrigidOptions options = all_cloth();
  options.blur_kernels = {3};  // a single step
  options.conjugate_gradients = 2;
  options.snap = false;
  options.max_isolated_motion = 0.0;
  NonrigidOptions without = options;
  without.warp_displacements = false;
  NonrigidStage with(bulge.character, bulge.camera, options), cold(bulge.character, bulge.camera, without);
  const auto energy_after = [&](NonrigidStage& stage) {
    double sum = 0.0;
    for (const TermCost& term : stage.fit(bulge.posed, bulge.outline, {}).terms) sum += term.cost;
    return sum;
  };
  double ahead = 0.0, anew = 0.0;
  for (int frame = 0; frame < 4; ++frame) {
    ahead = energy_after(with);
    anew = energy_after(cold);
  }
  EXPECT_LT(ahead, 0.9 * anew);
  // In the rest pose the displacements are turned back: posing them again gives the surface.
  const std::vector<Vector3d> rest = with.rest_vertices();
  const NonrigidSurface last = with.fit(bulge.posed, bulge.outline, {});
  const std::vector<Vector3d> now = with.rest_vertices();
  double largest = 0.0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const Vector3d displacement = last.vertices.col(column) - bulge.posed.vertices.col(column);
    EXPECT_LT((bulge.posed.turns[i] * (now[i] - bulge.character.mesh.vertices[i]) - displacement).norm(), 1e-9);
    largest = std::max(largest, displacement.norm());
  }
  EXPECT_GT(largest, 0.004);
  with.cut();
  EXPECT_EQ(with.rest_vertices(), bulge.character.mesh.vertices);
}

TEST(NonrigidStage, TermsOfWeightZeroAreOff) {
  const Bulge bulge;
  NonrigidOptions options;
  options.silhouette_weight = options.photometric_weight = options.velocity_weight = options.acceleration_weight = 0.0;
  options.length_weight = options.skinned_weight = 0.0;
  options.snap = false;
  NonrigidStage stage(bulge.character, bulge.camera, options);
  const NonrigidSurface found = stage.fit(bulge.posed, bulge.outline, bulge.image);
  ASSERT_EQ(found.terms.size(), 1u);
  EXPECT_EQ(found.terms[0].name, "smoothness");
  EXPECT_TRUE(found.vertices == bulge.posed.vertices) << "without data the skinned surface stays";
}

TEST(NonrigidStage, RigidMaterialsBendLess) {
  const Bulge bulge;
  const auto moved = [&](double rigidity) {
    NonrigidOptions options;
    options.materials = false;
    options.rigidity = rigidity;
    NonrigidStage stage(bulge.character, bulge.camera, options);
    return (stage.fit(bulge.posed, bulge.outline, {}).vertices - bulge.posed.vertices).norm();
  };
  EXPECT_GT(moved(2.0), 1.5 * moved(200.0));
}

TEST(NonrigidStage, HalfTheLightChangesLittle) {
  const Bulge bulge;
  NonrigidStage bright(bulge.character, bulge.camera), dark(bulge.character, bulge.camera);
  const NonrigidSurface one = bright.fit(bulge.posed, bulge.outline, bulge.image);
  const NonrigidSurface half = dark.fit(bulge.posed, bulge.outline, bulge.image * 0.5);
  EXPECT_GT(half.coloured_vertices, 9 * one.coloured_vertices / 10);
}

TEST(NonrigidStage, ABlackImageAndAStrangeMaskAreFinite) {
  const Bulge bulge;
  cv::Mat strange = cv::Mat::zeros(bulge.mask.size(), CV_8UC1);
  strange(cv::Rect(3, 3, 12, 9)).setTo(255);
  NonrigidStage stage(bulge.character, bulge.camera);
  for (int frame = 0; frame < 3; ++frame) {
    const NonrigidSurface found =
        stage.fit(bulge.posed, OutlineField(strange, 256), cv::Mat::zeros(bulge.image.size(), CV_8UC3));
    EXPECT_TRUE(found.vertices.allFinite());
    EXPECT_LT((found.vertices - bulge.posed.vertices).colwise().norm().maxCoeff(), 0.2);
  }
}

TEST(NonrigidStage, SameBitsWithAnyNumberOfThreads) {
  const Bulge bulge;
  const int before = at::get_num_threads();
  const auto solution = [&](int threads) {
    at::set_num_threads(threads);
    NonrigidStage stage(bulge.character, bulge.camera);
    stage.fit(bulge.posed, bulge.outline, bulge.image);
    return stage.fit(bulge.posed, bulge.outline, bulge.image).vertices;
  };
  const Eigen::Matrix3Xd one = solution(1), three = solution(3);
  at::set_num_threads(before);
  EXPECT_TRUE(one == three);
}

TEST(NonrigidStage, SaysWhatIsOutOfRange) {
  const Bulge bulge;
  NonrigidOptions options;
  options.smoothness_weight = -1.0;
  EXPECT_NE(message_of([&] { NonrigidStage(bulge.character, bulge.camera, options); }).find("smoothness weight"),
            std::string::npos);
  options = {};
  options.blur_kernels = {4};
  EXPECT_NE(message_of([&] { NonrigidStage(bulge.character, bulge.camera, options); }).find("odd"), std::string::npos);
}

TEST(VertexColours, AreTheTexturesAroundAVertex) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}};
  EXPECT_EQ(vertex_colours(mesh).cols(), 0);
  mesh.uvs = {{0.25, 0.25}, {0.75, 0.25}, {0.25, 0.75}};
  mesh.face_uvs = {{0, 1, 2}};
  mesh.texture = cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0));     // blue
  mesh.texture(cv::Rect(0, 0, 32, 32)).setTo(cv::Scalar(0, 0, 255));  // v > 0.5, u < 0.5: red
  const Eigen::Matrix3Xd colours = vertex_colours(mesh);
  EXPECT_TRUE(colours.col(0).isApprox(Vector3d(0, 0, 1)));
  EXPECT_TRUE(colours.col(2).isApprox(Vector3d(1, 0, 0)));
  mesh.colours.assign(3, Vector3d(0.1, 0.2, 0.3));
  EXPECT_TRUE(vertex_colours(mesh).col(1).isApprox(Vector3d(0.1, 0.2, 0.3)));
}

}  // namespace
}  // namespace doppel::nonrigid_stage_test
