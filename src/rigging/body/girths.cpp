#include "doppel/rigging/body/girths.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "doppel/core/error.h"
#include "doppel/rigging/body/measures.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

double distance(const BodyJoints& joints, const char* from, const char* to) {
  return (joints.at(to) - joints.at(from)).norm();
}

Vector3d level_forward(const BodyJoints& joints) {
  Vector3d forward = joints.at("left_toe_end") - joints.at("left_heel");
  forward.y() = 0;
  return forward.normalized();
}

/// Extent of the left foot in a direction: of the vertices below its ankle.
double foot_extent(const TriangleMesh& mesh, const BodyJoints& joints, const Vector3d& direction) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Vector3d& p : mesh.vertices) {
    if (p.x() < 0 || p.y() > joints.at("left_ankle").y()) continue;
    low = std::min(low, p.dot(direction));
    high = std::max(high, p.dot(direction));
  }
  return high - low;
}

}  // namespace

std::vector<SurfaceLoop> plane_section(const TriangleMesh& mesh, const Vector3d& origin, const Vector3d& normal) {
  const auto above = [&](int v) { return (mesh.vertices[v] - origin).dot(normal); };
  // Each cut face leads from the edge through which the surface rises above the plane to the edge where it falls.
  std::map<std::array<int, 2>, std::array<int, 2>> next;
  for (const Triangle& f : mesh.faces) {
    std::array<int, 2> rise{-1, -1}, fall{-1, -1};
    for (int c = 0; c < 3; ++c) {
      const int a = f[c], b = f[(c + 1) % 3];
      const bool from = above(a) >= 0, to = above(b) >= 0;
      if (from != to) (to ? rise : fall) = std::array{std::min(a, b), std::max(a, b)};
    }
    if (rise[0] >= 0) next[rise] = fall;
  }
  std::vector<SurfaceLoop> loops;
  while (!next.empty()) {
    SurfaceLoop loop;
    auto at = next.begin();
    while (at != next.end()) {
      const auto [a, b] = at->first;
      loop.push_back({a, b, above(a) / (above(a) - above(b))});
      const std::array<int, 2> to = at->second;
      next.erase(at);
      at = next.find(to);
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

SurfaceLoop nearest_section(const TriangleMesh& mesh, const Vector3d& origin, const Vector3d& normal) {
  SurfaceLoop best;
  double least = std::numeric_limits<double>::infinity();
  for (SurfaceLoop& loop : plane_section(mesh, origin, normal)) {
    Vector3d mean = Vector3d::Zero();
    for (const EdgePoint& p : loop) mean += p.on(mesh.vertices) / static_cast<double>(loop.size());
    if ((mean - origin).norm() >= least) continue;
    least = (mean - origin).norm();
    best = std::move(loop);
  }
  if (best.empty())
    fail("measuring a body: the plane at ({:.3f}, {:.3f}, {:.3f}) misses the mesh; are mesh and joints in one pose?",
         origin.x(), origin.y(), origin.z());
  return best;
}

double loop_length(const SurfaceLoop& loop, std::span<const Vector3d> vertices) {
  double length = 0;
  Vector3d before = loop.back().on(vertices);
  for (const EdgePoint& point : loop) {
    const Vector3d here = point.on(vertices);
    length += (here - before).norm();
    before = here;
  }
  return length;
}

double loop_extent(const SurfaceLoop& loop, std::span<const Vector3d> vertices, const Vector3d& direction) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const EdgePoint& point : loop) {
    const double along = point.on(vertices).dot(direction);
    low = std::min(low, along);
    high = std::max(high, along);
  }
  return high - low;
}

std::vector<GirthLevel> girth_levels(const BodyJoints& joints) {
  const Vector3d hips = 0.5 * (joints.at("left_hip") + joints.at("right_hip"));
  const Vector3d ahead = Vector3d::UnitZ(), side = Vector3d::UnitX(), round = Vector3d::Zero();
  std::vector<GirthLevel> levels;
  const auto add = [&](const char* measure, const Vector3d& from, const Vector3d& to, double t,
                       const Vector3d& direction) {
    levels.push_back({measure_index(measure), from + t * (to - from), (to - from).normalized(), direction});
  };
  const auto on_limb = [&](const char* measure, const char* from, const char* to, double t) {
    add(measure, joints.at(from), joints.at(to), t, round);
  };
  const Vector3d &neck = joints.at("neck"), &head = joints.at("head"), &top = joints.at("head_top");
  add("head_breadth", head, top, 0.42, side);
  add("head_depth", head, top, 0.42, ahead);
  // A tape around the neck lies lower in front, below the chin.
  const Vector3d along_neck = (head - neck).normalized();
  levels.push_back({measure_index("neck_girth"), neck + 0.3 * (head - neck),
                    (along_neck + 0.25 * (ahead - ahead.dot(along_neck) * along_neck)).normalized(), round});
  add("chest_girth", hips, neck, kChestLevel, round);
  add("chest_depth", hips, neck, kChestLevel, ahead);
  add("waist_girth", hips, neck, kWaistLevel, round);
  add("belly_depth", hips, neck, kWaistLevel, ahead);
  add("hip_girth", hips, neck, kHipLevel, round);
  on_limb("upper_arm_girth", "left_shoulder", "left_elbow", kUpperArmLevel);
  on_limb("forearm_girth", "left_elbow", "left_wrist", kForearmLevel);
  on_limb("wrist_girth", "left_elbow", "left_wrist", kWristLevel);
  on_limb("thigh_girth", "left_hip", "left_knee", kThighLevel);
  on_limb("knee_girth", "left_hip", "left_knee", 0.94);
  on_limb("calf_girth", "left_knee", "left_ankle", kCalfLevel);
  on_limb("ankle_girth", "left_knee", "left_ankle", kAnkleLevel);
  const Vector3d hand = joints.at("left_fingertip") - joints.at("left_wrist");
  const Vector3d palm = (ahead - ahead.dot(hand.normalized()) * hand.normalized()).normalized();
  add("hand_breadth", joints.at("left_wrist"), joints.at("left_fingertip"), 0.46, palm);
  return levels;
}

std::vector<double> measure_body(const TriangleMesh& mesh, const BodyJoints& joints) {
  std::vector<double> m(body_measures().size(), 0.0);
  const auto set = [&](const char* name, double value) { m[measure_index(name)] = value; };
  set("upper_arm_length", distance(joints, "left_shoulder", "left_elbow"));
  set("forearm_length", distance(joints, "left_elbow", "left_wrist"));
  set("hand_length", distance(joints, "left_wrist", "left_fingertip"));
  set("shoulder_breadth", distance(joints, "left_shoulder", "right_shoulder"));
  set("hip_breadth", distance(joints, "left_hip", "right_hip"));
  set("thigh_length", distance(joints, "left_hip", "left_knee"));
  set("shin_length", distance(joints, "left_knee", "left_ankle"));
  set("ankle_height", joints.at("left_ankle").y());
  set("trunk_length", (joints.at("neck") - 0.5 * (joints.at("left_hip") + joints.at("right_hip"))).norm());
  set("neck_length", distance(joints, "neck", "head"));
  set("head_height", distance(joints, "head", "head_top"));
  const Vector3d forward = level_forward(joints);
  set("foot_length", foot_extent(mesh, joints, forward));
  set("foot_breadth", foot_extent(mesh, joints, Vector3d::UnitY().cross(forward)));
  for (const GirthLevel& level : girth_levels(joints)) {
    const SurfaceLoop loop = nearest_section(mesh, level.origin, level.normal);
    m[level.measure] =
        level.direction.isZero() ? loop_length(loop, mesh.vertices) : loop_extent(loop, mesh.vertices, level.direction);
  }
  return m;
}

}  // namespace doppel
