#include "doppel/rigging/joints/head_measures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/detect/face/face_landmarks.h"
#include "doppel/detect/face/face_pose.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// The distance along a ray to a triangle, or a negative number.
double ray_triangle(const Vector3d& from, const Vector3d& direction, const Vector3d& a, const Vector3d& b,
                    const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, p = direction.cross(ac);
  const double determinant = ab.dot(p);
  if (std::abs(determinant) < 1e-15) return -1.0;
  const Vector3d t = from - a, q = t.cross(ab);
  const double u = t.dot(p) / determinant, v = direction.dot(q) / determinant;
  return u < 0 || v < 0 || u + v > 1 ? -1.0 : ac.dot(q) / determinant;
}

/// `left` from the ears or the eyes where they are known.
BodyFrame head_axes(const BodyJoints& joints) {
  BodyFrame axes = chest_frame(joints);
  for (const std::string part : {"ear", "eye"}) {
    if (!joints.has("left_" + part) || !joints.has("right_" + part)) continue;
    const Vector3d left = joints.at("left_" + part) - joints.at("right_" + part);
    if (left.norm() < 0.01 || left.normalized().cross(axes.up).norm() < 0.5) continue;
    axes.left = left.normalized();
    axes.forward = axes.left.cross(axes.up).normalized();
    axes.up = axes.forward.cross(axes.left);
    break;
  }
  return axes;
}

/// The highest vertex around the axis through the head.
Vector3d find_top(const TriangleMesh& mesh, const BodyJoints& joints, const BodyFrame& axes, double trunk) {
  const Vector3d& head = joints.at("head");
  double highest = (joints.at("head_top") - head).dot(axes.up) * 0.5;
  for (const Vector3d& p : mesh.vertices) {
    const Vector3d away = p - head;
    const double up = away.dot(axes.up);
    if (up > highest && up < trunk && (away - up * axes.up).norm() < 0.2 * trunk) highest = up;
  }
  return head + highest * axes.up;
}

/// The foremost point on the middle line of the face.
Vector3d find_nose(const TriangleMesh& mesh, const BodyJoints& joints, const HeadMeasures& head) {
  if (joints.has("nose")) return joints.at("nose");
  Vector3d best = joints.at("head") + 0.45 * head.height * head.axes.forward;
  double foremost = -1.0;
  constexpr int kRays = 33;
  for (int i = 0; i < kRays; ++i) {
    const double below = 0.45 + 0.35 * i / (kRays - 1);  // from the top, in head heights
    const Vector3d from = head.top - below * head.height * head.axes.up;
    const auto hit = last_hit(mesh, from, head.axes.forward, 0.8 * head.height);
    if (!hit || (*hit - from).dot(head.axes.forward) <= foremost) continue;
    foremost = (*hit - from).dot(head.axes.forward);
    best = *hit;
  }
  return best;
}

}  // namespace

std::optional<Vector3d> last_hit(const TriangleMesh& mesh, const Vector3d& from, const Vector3d& direction,
                                 double farthest) {
  double last = -1.0;
  for (const Triangle& face : mesh.faces) {
    const double t =
        ray_triangle(from, direction, mesh.vertices[face[0]], mesh.vertices[face[1]], mesh.vertices[face[2]]);
    if (t <= farthest) last = std::max(last, t);
  }
  if (last < 0) return std::nullopt;
  return Vector3d(from + last * direction);
}

HeadMeasures measure_head(const TriangleMesh& mesh, const BodyJoints& joints) {
  HeadMeasures head;
  head.axes = head_axes(joints);
  const double trunk = (0.5 * (joints.at("left_shoulder") + joints.at("right_shoulder")) -
                        0.5 * (joints.at("left_hip") + joints.at("right_hip")))
                           .norm();
  head.top = find_top(mesh, joints, head.axes, trunk);
  // High hair must not make the face large.
  head.height = std::min(0.75 * (head.top - joints.at("neck")).dot(head.axes.up), 0.6 * trunk);
  head.height = std::max(head.height, 0.3 * trunk);
  head.nose = find_nose(mesh, joints, head);
  return head;
}

std::vector<Vector3d> face_points() {
  std::vector<Vector3d> points;
  const auto add = [&](double x, double y) { points.emplace_back(x, y, -0.05 - 3.5 * x * x); };
  for (int i = 0; i <= 16; ++i) {  // the jaw, from ear to ear below the chin
    const double angle = M_PI * i / 16;
    points.emplace_back(-0.31 * std::cos(angle), 0.13 - 0.44 * std::sin(angle), -0.5 + 0.42 * std::sin(angle));
  }
  constexpr std::array<std::array<double, 2>, 5> kBrow{
      {{-0.25, 0.23}, {-0.21, 0.265}, {-0.155, 0.275}, {-0.10, 0.265}, {-0.05, 0.245}}};
  for (const auto& [x, y] : kBrow) add(x, y);
  for (auto it = kBrow.rbegin(); it != kBrow.rend(); ++it) add(-(*it)[0], (*it)[1]);
  for (const double y : {0.17, 0.115, 0.06, 0.0}) add(0, y);
  for (const auto& [x, y] : std::array<std::array<double, 2>, 5>{
           {{-0.075, -0.035}, {-0.04, -0.045}, {0, -0.055}, {0.04, -0.045}, {0.075, -0.035}}})
    add(x, y);
  for (const auto& [x, y] : std::array<std::array<double, 2>, 6>{
           {{-0.205, 0.17}, {-0.165, 0.19}, {-0.115, 0.19}, {-0.075, 0.165}, {-0.115, 0.15}, {-0.165, 0.15}}})
    add(x, y);
  for (const auto& [x, y] : std::array<std::array<double, 2>, 6>{
           {{0.075, 0.165}, {0.115, 0.19}, {0.165, 0.19}, {0.205, 0.17}, {0.165, 0.15}, {0.115, 0.15}}})
    add(x, y);
  for (const auto& [x, y] : std::array<std::array<double, 2>, 12>{{{-0.11, -0.17},
                                                                   {-0.07, -0.135},
                                                                   {-0.025, -0.125},
                                                                   {0, -0.13},
                                                                   {0.025, -0.125},
                                                                   {0.07, -0.135},
                                                                   {0.11, -0.17},
                                                                   {0.07, -0.205},
                                                                   {0.03, -0.22},
                                                                   {0, -0.222},
                                                                   {-0.03, -0.22},
                                                                   {-0.07, -0.205}}})
    add(x, y);
  for (const auto& [x, y] : std::array<std::array<double, 2>, 8>{{{-0.09, -0.168},
                                                                  {-0.04, -0.155},
                                                                  {0, -0.155},
                                                                  {0.04, -0.155},
                                                                  {0.09, -0.168},
                                                                  {0.04, -0.18},
                                                                  {0, -0.182},
                                                                  {-0.04, -0.18}}})
    add(x, y);
  return points;
}

std::vector<NamedFacePoint> face_mesh_points() {
  constexpr double kHeadHeight = 22.0;  // of the mean face, centimetres
  const auto position = [](const FaceLandmark& landmark) -> Vector3d {
    return Vector3d::Map(landmark.position.data());
  };
  const auto tip = std::ranges::find(kFaceLandmarks, kFaceTip, &FaceLandmark::point);
  std::vector<NamedFacePoint> points;
  points.reserve(kFaceLandmarks.size());
  for (const FaceLandmark& landmark : kFaceLandmarks)
    points.push_back({face_point_name(landmark.point), (position(landmark) - position(*tip)) / kHeadHeight});
  return points;
}

}  // namespace doppel
