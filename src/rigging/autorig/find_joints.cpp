#include "doppel/rigging/autorig/find_joints.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/rigging/autorig/draw_scan.h"
#include "doppel/rigging/autorig/joints_from_points.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr double kMinShareWithPerson = 0.25;       // share of the views; stylised figures are found in few
constexpr double kMaxShareWithSeveral = 0.4;       // share of the views
constexpr double kSeenLegs = 0.3;                  // mean visibility of knees and ankles
constexpr double kBelowScan = 0.05;                // ankles may lie below the scan by this share of its height
constexpr double kBentHip = 1.2, kBentKnee = 1.2;  // radians from straight: a person who sits

void check_people(const BodyPoints& points) {
  const double count = static_cast<double>(points.views.size());
  if (points.views_with_person() < kMinShareWithPerson * count)
    fail(
        "finding joints: a person was found in {} of {} images of the scan; expected is one standing person. If the "
        "scan lies on its side or stands on its head, say which axis points up (--up); if it is no whole person, give "
        "the joints yourself (--joints)",
        points.views_with_person(), points.views.size());
  const auto several =
      std::count_if(points.views.begin(), points.views.end(), [](const ScanView& view) { return view.people > 1; });
  if (static_cast<double>(several) > kMaxShareWithSeveral * count)
    fail(
        "finding joints: {} of {} images of the scan show more than one person; cut the scan so that one person is "
        "left",
        several, points.views.size());
}

/// A bust has no knees and ankles: BlazePose guesses them, with low visibility, below the end of the scan.
void check_legs(const BodyPoints& points, const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : mesh.vertices) box.extend(vertex);
  const double lowest = box.min().y() - kBelowScan * box.sizes().y();
  for (const std::size_t k : {25u, 26u, 27u, 28u}) {
    const bool inside = points.positions[k] && points.positions[k]->y() > lowest;
    if (inside && points.visibility[k] > kSeenLegs) continue;
    fail(
        "finding joints: {} is not in the scan (seen with a probability of {:.2f}); a whole person from head to feet "
        "is needed, a bust cannot be rigged",
        kBodyLandmarkNames[k], points.visibility[k]);
  }
}

double angle_between(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0));
}

cv::Point2d pixel_of(const Camera& camera, const Vector3d& point) {
  const Eigen::Vector2d pixel = camera.project(point);
  return {pixel.x(), pixel.y()};
}

void draw_joints(cv::Mat& image, const Camera& camera, const BodyJoints& joints) {
  static constexpr const char* kLines[][2] = {
      {"pelvis", "spine"},    {"spine", "chest"},         {"chest", "neck"},       {"neck", "head"},
      {"chest", "*clavicle"}, {"*clavicle", "*shoulder"}, {"*shoulder", "*elbow"}, {"*elbow", "*wrist"},
      {"pelvis", "*hip"},     {"*hip", "*knee"},          {"*knee", "*ankle"},     {"*ankle", "*toe"}};
  const cv::Scalar left(60, 60, 230), right(220, 120, 40), middle(60, 200, 240);
  for (const auto& line : kLines)
    for (const std::string side : {"left_", "right_"}) {
      const auto name = [&](const char* word) { return word[0] == '*' ? side + (word + 1) : std::string(word); };
      const std::string a = name(line[0]), b = name(line[1]);
      if (!joints.has(a) || !joints.has(b)) continue;
      const cv::Scalar colour = line[1][0] != '*' ? middle : side == "left_" ? left : right;
      cv::line(image, pixel_of(camera, joints.at(a)), pixel_of(camera, joints.at(b)), colour, 2, cv::LINE_AA);
      cv::circle(image, pixel_of(camera, joints.at(b)), 4, colour, cv::FILLED, cv::LINE_AA);
    }
}

}  // namespace

std::string pose_fault(const BodyJoints& joints) {
  for (const std::string side : {"left_", "right_"}) {
    const Vector3d thigh = joints.at(side + "knee") - joints.at(side + "hip");
    const Vector3d shank = joints.at(side + "ankle") - joints.at(side + "knee");
    const Vector3d trunk = 0.5 * (joints.at("left_hip") + joints.at("right_hip") - joints.at("left_shoulder") -
                                  joints.at("right_shoulder"));
    if (angle_between(trunk, thigh) > kBentHip && angle_between(thigh, shank) > kBentKnee)
      return "the person sits; scan the person standing, with the arms away from the trunk";
  }
  return "";
}

FoundJoints find_joints(const TriangleMesh& mesh, const BodyPointsOptions& options) {
  FoundJoints found;
  found.points = find_body_points(mesh, options);
  check_people(found.points);
  check_legs(found.points, mesh);
  found.joints = joints_from_points(found.points.positions);
  for (const std::string& name : limb_joint_names())
    if (!found.joints.has(name))
      fail("finding joints: {} was seen in fewer than three of {} images; give the joints yourself (--joints)", name,
           found.points.views.size());
  complete_joints(found.joints);
  if (const std::string fault = pose_fault(found.joints); !fault.empty()) fail("finding joints: {}", fault);
  found.doubts = examine_joints(found.joints);
  return found;
}

cv::Mat draw_joint_sheet(const TriangleMesh& mesh, const BodyJoints& joints) {
  constexpr int kColumns = 4, kRows = 2, kSide = 512;
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : mesh.vertices) box.extend(vertex);
  ScanPainter painter(mesh);
  cv::Mat sheet(kRows * kSide, kColumns * kSide, CV_8UC3);
  int i = 0;
  for (const PinholeCamera& camera : cameras_around(box, kRows * kColumns, 0.0, 0.0, kSide)) {
    cv::Mat image = painter.draw(camera);
    draw_joints(image, camera, joints);
    image.copyTo(sheet(cv::Rect(i % kColumns * kSide, i / kColumns * kSide, kSide, kSide)));
    ++i;
  }
  return sheet;
}

}  // namespace doppel
